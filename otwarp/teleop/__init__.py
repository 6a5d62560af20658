"""A scene, live: the loop that couples simulation, servo and page; the reduced scene; recordings and their replay."""
