"""Reports over stored runs: they read `ninedisk.harness.records` data and nothing else.

Public entry: `ninedisk.reports.build.build_report`.
"""
