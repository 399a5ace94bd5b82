"""Facts that results are compared with: closed forms, exact solutions of discrete schemes, published values and claims.

Imports nothing of the project outside itself, so that a reference never shares code with what it judges.

`ninedisk.references.analytic`
    Closed forms of the continuous problems, one a file.
`ninedisk.references.exact_steps`
    Exact solutions of the time-discrete schemes, one problem a file.
`ninedisk.references.hertz_mindlin`, `hertz_chain`
    Impacts by Hertz's law, integrated to round-off, and what central differences err by.
`ninedisk.references.published_values`, `published_formulas`, `published_impacts`, `published_curves`
    What the source text says, with places and quotes; curves that others read off figures; digitised curves of a user.
`ninedisk.references.converged_tables`
    Fine-step limits of the core's own runs, with their uncertainties.
"""
