"""The recording room: frames of a run to USD, netCDF, a summary and a figure, as they come.

from otwarp.record.recorder import Recorder
with Recorder(scene, "out/run", frames_per_second=60.0) as recorder:
    recorder.write(frame)
"""
