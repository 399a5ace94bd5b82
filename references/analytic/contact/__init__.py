"""Closed forms of one contact, or one body, that is driven: forces, shear, stability."""
