"""The closed loop: a camera's images say where the bodies of a twin are, and hands feel the twin.

Two simulations that are kept apart: the plant, which is the laboratory, and the twin, which a live session steps and
its hands feel. Traps are all that goes from the twin to the plant, images all that comes back; a real camera takes the
place of the plant. Open `closed_loop` first; floor plan, each file importing only from those above it:

    camera                       what a camera is: frames, regions, and when their light was
    plant, photographer          the laboratory in motion; what its microscope records
    simulated                    both in this process, on any clock
    hidden, estimator            what others cover of a body; from frames to measurements of bodies
    link, lab                    latest values for other processes; the laboratory in a process of its own
    files, opencv, genicam,      images taken before; a video device; GenICam;
    topics, kinds                topics of ROS; all of these by their names
    calibrated                   the camera as a calibration file has it
    followed                     a body's tracker; when it counts as lost
    latency                      from light to state, stage by stage
    looker                       who reads the camera and asks the estimator
    overlaps                     bodies that images put into each other, pushed apart
    recorded                     looks and turns as JSON, bit for bit
    closed_loop                  what the live loop asks: bodies put where they are
    sources, assemble            templates and networks for the bodies of a scene; all of it from a user's words
    process                      camera and estimator in a process of their own
    replay                       recorded images, looked at again: the same estimates and states?
"""
