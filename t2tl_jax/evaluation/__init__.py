"""What a trained agent does: success, return, steps, pictures."""
