"""What each item says: Markdown made from its runs, of which any may be missing; one module an item, or a few alike."""
