"""Reports over stored runs: they read `ninedisk.harness.results.schema` data and nothing else.

Public entry: `ninedisk.reports.build.build_report`.
"""
