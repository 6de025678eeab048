"""What serves the papers: their published figures, and the tables beside them."""
