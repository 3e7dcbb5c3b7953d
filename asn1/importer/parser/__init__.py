"""Parser of ASN.1 text to a syntax tree; errors cite the line.

Face: fault, lexer, syntax, type_parser, module_parser.
"""
