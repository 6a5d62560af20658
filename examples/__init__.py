"""Short scripts, one idea each: `python -m examples.first_run`. The tests run all of them with small sizes."""
