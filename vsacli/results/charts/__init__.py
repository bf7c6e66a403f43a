"""Charts, declared once with their curves, bands, limits and titles; figures and pages draw them."""
