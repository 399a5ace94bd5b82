"""Exact solutions of time-discrete schemes, one problem a file.

A solution here binds only engines of that very scheme, and those to round-off; every other engine is judged on
`ninedisk.references.analytic`. Recurrences run in `numpy.longdouble` and are rounded once, at the end.
"""
