"""Facts that results are compared with: closed forms, exact solutions of discrete schemes, published values and claims.

Imports nothing of the project outside itself, so that a reference never shares code with what it judges.

`ninedisk.references.analytic`
    Closed forms of the continuous problems, one a file.
`ninedisk.references.exact_steps`
    Exact solutions of the time-discrete schemes, one problem a file.
`ninedisk.references.published_values`, `published_curves`, `claims`
    What the source text says, with places and quotes; digitised curves of a user.
`ninedisk.references.converged_tables`
    Fine-step limits of the core's own runs, with their uncertainties.
"""
