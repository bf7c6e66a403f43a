"""Charts, declared once: which curves, bands, limits and titles there are. Figures and pages draw them."""
