"""Labelled environments with the brax interface: they offer propositions and labels, and know no temporal logic."""
