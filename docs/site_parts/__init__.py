"""What the site has beside its pages: contents, descriptions of the Python names, formulas, manual pages."""
