"""Resolver: converts syntax trees to a schema; names, values, constraints, object sets, tags, units.

Face: program, resolver, units.
"""
