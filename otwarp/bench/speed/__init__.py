"""`otwarp bench speed`: steps per second of typical scenes, beside codes written for one of them.

`measure` (open it first) runs it and gives a `result`, in memory and as JSON, which `figure` draws and `table` prints.

    workloads  what is stepped, how it is counted, and how fast it should be
    many_body  case b, soft Brownian spheres that touch
    peers      the same work as other people would write it
"""
