"""`python -m docs.figures`: write all pictures, and the table of rooms, anew."""

from docs.figures import flow, rooms

if __name__ == "__main__":
    rooms.write()
    flow.write()
