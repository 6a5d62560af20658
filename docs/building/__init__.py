"""How the site of the documentation is made: `make docs` builds it, `mkdocs.yml` says what is in it.

`hook` is what MkDocs calls. `links` gives files of the repository that pages link to (README, sources) a page of their
own, `reference` makes those of commands and of the Python API, `docstrings` says how docstrings are read.
`blocks` runs the code of the tutorials and keeps their pictures: a command of its own.
"""
