"""Kinds of declared values, with all that is done with each: reading, checks, schema, lines, arrays.

Nothing compares kinds, so their classes have no `__eq__`: to generate it takes a third of the time in which
these modules are imported, at the start of every command.
"""
