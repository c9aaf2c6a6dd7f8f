"""Figures: what they show, and how that is drawn for a page and for files."""
