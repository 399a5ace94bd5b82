"""Reports over stored runs: they read data of `ninedisk.harness.results`, its modules schema and figures, and nothing else.

Public entry: `ninedisk.reports.build.build_report`.
"""
