"""What late and wrong estimates of where robots are do to SIMULATED operators: to what they feel, and what they do.

errors        `Perception`: delay, frame rate, errors of a pose, lost pictures; open this first
sensing       pictures, estimates and delays between states and servo chains, on the device
loop          the loop of simulated operators with that in it, and how true its forces are
probe         hands without people: phases of the force, and whether a hand that is held still sways
cycles        whether it has a limit cycle, or only sways
sweep         which operators do the task with which perceptions
folder        a sweep on disk
summary       maps over delay and error, each cell against no error and no haptics
figure        the same as a picture
export        the same as data
"""
