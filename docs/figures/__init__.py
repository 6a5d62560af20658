"""Pictures of the documents that are drawn from the code: `python -m docs.figures` writes them all anew.

`rooms` draws who may import whom and writes the table of the rooms in docs/architecture.md, `flow` draws the way of the
data. Each picture carries what it shows in its metadata, so that a test can compare it with the code. `samples`, which
renders and is a command of its own, draws the images of docs/vision_data.md.
"""
