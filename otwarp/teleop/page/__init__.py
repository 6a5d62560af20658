"""The page: a session in a browser, drawn and asked by viser in a process of its own.

In come `LiveFrame`s, out come commands. Open `process` first; its other end is `child`.

session's process
    process           `PageProcess`, the sink: starts the child, sends frames, takes in what its users ask
    compose           a scene → what is drawn of it: solids as triangles, balls, traps, a camera
    measure           how long a state takes to the page, with a browser without a window
both
    protocol          what the two processes say to each other, and how it passes through a pipe
    access            who may see and use the page, and the socket it listens on
child's process
    child             `Page`: one thread that does everything in the order in which it comes
    viser_internals   what reaches into viser, and why: the guard before every request, above all
    scene_view        what is seen in 3-D
    gizmos            handles that are dragged
    controls          buttons and sliders
    readout           texts and plots
"""
