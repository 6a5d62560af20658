"""Live sessions: a scene simulated in pace with the clock, moved by operators, felt, shown and recorded.

In comes a scene, with devices for its hands; out come frames (`core.LiveFrame`), 120 a second, and recordings that
replay bit for bit. Open `session` first (what `otwarp teleop` runs), then `session.live` (one tick of it).

    core        what all speak: frames out, commands in, `Sink`, and how simulated time follows the clock's
    operators   which hand moves which traps, what it feels of the scene, and the servo between
    recording   the file of a session, its writer beside the loop, and the replay of its forces
    budget      the reduced scene: what this machine carries in time with the clock
    page        the session in a browser, in a process of its own
    session     the live loop that couples all of these to a simulation, and the session around it

`core` imports none of the others, `session` all of them, and the rest `core` alone (`budget` not even that).
"""
