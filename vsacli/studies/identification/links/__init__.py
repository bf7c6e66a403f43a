"""Equations of links, their base parameters, and bodies that have them."""
