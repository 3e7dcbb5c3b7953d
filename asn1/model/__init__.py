"""Model of the standards: schema of types and constraints, and its text.

Face: types, selection, constraints, text, constraint_text, forms.
"""
