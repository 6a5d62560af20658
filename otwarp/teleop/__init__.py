"""The live loop that couples simulation, servo and page; the page; the reduced scene; takes and their replay."""
