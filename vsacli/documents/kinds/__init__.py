"""Kinds of declared values, with all that is done with each: reading, checks, schema, lines, arrays."""
