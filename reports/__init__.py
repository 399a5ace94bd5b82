"""Reports over stored runs: they read data of `ninedisk.harness.results`, its modules schema, statuses and figures, and nothing else.

Public entry: `ninedisk.reports.build.build_report`.
"""
