"""Cameras that are not simulated: files, and doubles of the device of OpenCV and of the camera of harvesters."""

from __future__ import annotations

import gc
import os
import subprocess
import sys
import time
from types import ModuleType, SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest
from PIL import Image

from otwarp.errors import InputError
from otwarp.perception.camera import CameraFrame, CameraLost
from otwarp.perception.files import FileCamera
from otwarp.perception.genicam import CLOCK_OVER, GenicamCamera, bits_of
from otwarp.perception.kinds import make_camera

LEVELS = np.arange(48, dtype=np.uint8).reshape(6, 8)
"""Row 0 the lowest."""
PATIENCE = 20.0
CODEC = 3.0
"""Mean difference in levels of 255 after H.264, most of it at edges."""


def soon(camera) -> CameraFrame:
    """The next frame of a camera that has a thread of its own."""
    end = time.perf_counter() + PATIENCE
    while (frame := camera.read(time.perf_counter())) is None:
        assert time.perf_counter() < end
        time.sleep(0.005)
    return frame


@pytest.fixture
def folder(tmp_path):
    """Three images, whose corner counts them."""
    for n in range(3):
        page = LEVELS.copy()
        page[0, 0] = n
        Image.fromarray(page[::-1]).save(tmp_path / f"{n}.png")
    return tmp_path


def test_a_folder_is_played_at_its_rate(folder):
    camera = make_camera(f"files:{folder},rate=50")
    camera.open()
    first = camera.read(10.0)
    assert first is not None and (first.number, first.time) == (1, 10.0)
    assert np.array_equal(first.pieces[0].levels, LEVELS)
    assert camera.read(10.01) is None
    last = camera.read(10.045)  # the one between was too late
    assert last is not None and (last.number, last.pieces[0].levels[0, 0]) == (3, 2)
    assert last.time == pytest.approx(10.04)
    with pytest.raises(CameraLost, match="has ended after 3 images"):
        camera.read(10.05)


def test_times_of_a_folder_may_go_back(folder):
    (folder / "times.csv").write_text("0.png,5.0\n1.png,5.2\n2.png,5.1\n", encoding="utf-8")
    camera = FileCamera(str(folder))
    camera.open()
    times = [frame.time for now in (0.0, 0.2, 0.201) if (frame := camera.read(now)) is not None]
    assert times == pytest.approx([0.0, 0.1])  # the second and third are there at once, in their order


def test_images_at_the_same_time_or_of_another_size_are_refused_before_anything_runs(folder):
    (folder / "times.csv").write_text("0.png,5.0\n1.png,5.2\n2.png,5.0\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"times\.csv: 0\.png and 2\.png have the same time, 5 s"):
        FileCamera(str(folder)).open()
    (folder / "times.csv").unlink()
    for file, save in (("3.png", lambda p: Image.fromarray(LEVELS[:, :4]).save(p)),
                       ("3.npy", lambda p: np.save(p, LEVELS[:, :4]))):  # fmt: skip
        save(folder / file)
        with pytest.raises(InputError, match=rf"{file}: is 4 × 6 pixels; allowed: 8 × 6, as 0\.png"):
            FileCamera(str(folder)).open()
        (folder / file).unlink()
    (folder / "3.png").write_bytes(b"no image")
    with pytest.raises(InputError, match=r"3\.png: cannot be read"):
        FileCamera(str(folder)).open()
    (folder / "3.png").unlink()
    with (folder / "3.npy").open("wb") as file:
        np.savez(file, one=LEVELS, other=LEVELS)
    with pytest.raises(InputError, match=r"3\.npy: cannot be read \(it is an archive of several arrays\)"):
        FileCamera(str(folder)).open()
    np.save(folder / "3.npy", LEVELS[0])
    with pytest.raises(InputError, match=r"3\.npy: cannot be read \(its shape is \(8,\)\)"):
        FileCamera(str(folder)).open()


@pytest.mark.parametrize("name", ["3.png", "3.tif", "3.npy"])
def test_an_image_that_is_cut_off_is_refused_before_anything_runs(name, folder):
    """Its header is whole, so that it opens; what follows a PNG's end is nobody's business."""
    page = np.random.default_rng(0).integers(0, 256, (60, 80)).astype(np.uint8)
    for old in folder.glob("*.png"):
        Image.fromarray(page).save(old)
    file = folder / name
    np.save(file, page) if name.endswith("npy") else Image.fromarray(page).save(file)
    whole = file.read_bytes()
    FileCamera(str(folder)).open()
    if name.endswith("png"):
        file.write_bytes(whole + b"written by a camera")
        FileCamera(str(folder)).open()
    for length in (len(whole) // 2, len(whole) - 13):
        file.write_bytes(whole[:length])
        with pytest.raises(InputError, match=rf"{name}: cannot be read") as error:
            FileCamera(str(folder)).open()
        assert "\n" not in str(error.value)


def test_an_image_that_turns_out_damaged_ends_the_camera(folder):
    """Bytes that differ within a whole file, or a file that has gone since: the session goes on without the camera."""
    whole = (folder / "1.png").read_bytes()
    middle = whole.index(b"IDAT") + 6
    for damage, said in ((whole[:middle] + b"damaged" + whole[middle + 7 :], "cannot be read"), (None, "no such file")):
        (folder / "1.png").write_bytes(whole)
        camera = make_camera(f"files:{folder},rate=50")
        if damage is not None:
            (folder / "1.png").write_bytes(damage)
        camera.open()
        if damage is None:
            (folder / "1.png").unlink()
        assert camera.read(0.0) is not None
        with pytest.raises(CameraLost, match=rf"camera files:{folder},rate=50: .*1\.png: .*{said}") as error:
            camera.read(0.02)
        assert "\n" not in str(error.value)


def test_pages_arrays_and_sixteen_bits(tmp_path):
    wide = LEVELS.astype(np.uint16) << 8
    np.save(tmp_path / "stack.npy", np.stack([wide, wide]))
    Image.fromarray(LEVELS[::-1]).save(tmp_path / "stack.tif", save_all=True, append_images=[Image.fromarray(LEVELS)])
    for name in ("stack.npy", "stack.tif"):
        camera = make_camera(f"files:{tmp_path / name}")
        camera.open()
        frame = camera.read(0.0)
        assert frame is not None and np.array_equal(frame.pieces[0].levels, LEVELS)


# imageio-ffmpeg leaves its ends of the pipes to the collector
@pytest.mark.filterwarnings("ignore:unclosed file:ResourceWarning")
def test_a_video_is_played_at_its_own_rate(tmp_path, monkeypatch):
    """By imageio, where OpenCV is absent: frames within what H.264 loses, their times, and the end."""
    pytest.importorskip("imageio", reason="reads the video")
    pytest.importorskip("imageio_ffmpeg", reason="of the extra movie")
    from otwarp.preview.video import save_video

    monkeypatch.setitem(sys.modules, "cv2", None)
    frames = np.full((4, 48, 64), 40, dtype=np.uint8)
    for n, frame in enumerate(frames):
        frame[4:16, 12 * n : 12 * n + 12] = 200  # near the top of the picture
    save_video(np.repeat(frames[..., None], 3, axis=3), tmp_path / "lab.mp4", 25.0)
    camera = make_camera(f"files:{tmp_path / 'lab.mp4'}")
    camera.open()
    assert camera.info.size == (64, 48) and not camera.info.caution
    for n, frame in enumerate(frames):
        assert n == 0 or camera.read(10.0 + n / 25.0 - 1e-3) is None
        found = camera.read(10.0 + n / 25.0 + 1e-3 * (n > 0))
        assert found is not None and (found.number, found.time) == (n + 1, pytest.approx(10.0 + n / 25.0))
        assert np.abs(found.pieces[0].levels[::-1].astype(float) - frame).mean() < CODEC
    with pytest.raises(CameraLost, match="has ended after 4 images"):
        camera.read(10.2)
    (tmp_path / "lab.mp4").write_bytes(b"no video")
    with pytest.raises(InputError, match=r"lab\.mp4: cannot be read") as error:
        make_camera(f"files:{tmp_path / 'lab.mp4'}").open()
    assert "\n" not in str(error.value)
    del error
    gc.collect()  # while the filter holds


def test_ten_bits_in_sixteen(tmp_path):
    """A camera of 10 bits leaves the highest six empty: without a word of that its images would have four levels."""
    np.save(tmp_path / "ten.npy", (LEVELS.astype(np.uint16) << 2)[None])
    camera = make_camera(f"files:{tmp_path / 'ten.npy'},bits=10")
    camera.open()
    frame = camera.read(0.0)
    assert frame is not None and np.array_equal(frame.pieces[0].levels, LEVELS) and camera.info.size == (8, 6)
    with pytest.raises(InputError, match=r"levels go up to 188 of the 65535 of 16 bits; allowed: say how many bits"):
        make_camera(f"files:{tmp_path / 'ten.npy'}").open()
    np.save(tmp_path / "ten.npy", np.full((1, 6, 8), 1024, dtype=np.uint16))
    with pytest.raises(InputError, match="levels go up to 1024; allowed with 10 bits: 1023"):
        camera.open()
    assert [bits_of(name) for name in ("Mono8", "Mono10", "Mono12p", "Mono16", "")] == [8, 10, 12, 16, 16]


@pytest.mark.parametrize(
    ("spec", "said"),
    [
        ("files:x,bits=8", "bits is 8; allowed: 9 to 16"),
        ("files:x,shift=nan", "shift is nan; allowed: a finite time"),
        ("usb:0", "--camera is 'usb:0'; allowed: the scene's own by its name, or files:…, v4l2:…"),
        ("files:", "--camera is 'files:'; allowed: files:WHERE, a folder of images"),
        ("files:x,speed=3", "has 'speed=3'; allowed: rate=, loop=, shift="),
        ("files:x,rate=soon", "rate is 'soon'; allowed: a number"),
        ("files:x,rate=0", "rate is 0; allowed: 0.01 to 10000 images per second"),
        ("genicam:0", "names no producer; allowed: genicam:WHERE,cti=FILE.cti"),
    ],
)
def test_what_no_camera_is_called(spec, said):
    with pytest.raises(InputError) as error:
        make_camera(spec)
    assert said in str(error.value) and "\n" not in str(error.value)


def test_what_cannot_be_opened(tmp_path):
    (tmp_path / "none").mkdir()
    for where, said in ((tmp_path / "none", "holds no image"), (tmp_path / "absent.tif", "there is no such file"),
                        (tmp_path / "absent.mp4", "there is no such file"),
                        (tmp_path / "absent", "absent: there is no such file or folder; allowed: a fol")):  # fmt: skip
        with pytest.raises(InputError, match=said):
            make_camera(f"files:{where}").open()


def double_of_opencv(frames) -> ModuleType:
    """A module with what the binding uses of OpenCV, as its documentation has it."""
    cv2 = ModuleType("cv2")
    for n, name in enumerate(("BUFFERSIZE", "FPS", "AUTO_EXPOSURE", "EXPOSURE")):
        setattr(cv2, f"CAP_PROP_{name}", n)

    class VideoCapture:
        asked: ClassVar[dict[int, float]] = {}

        def __init__(self, where):
            self.where, self.left = where, list(frames)

        def isOpened(self):
            return self.where == 0

        def set(self, prop, value):
            self.asked[prop] = value
            return True

        def read(self):
            return (True, self.left.pop(0)) if self.left else (False, None)

        def release(self):
            self.left.clear()

    cv2.VideoCapture = VideoCapture  # type: ignore[attr-defined]
    return cv2


def test_a_video_device(monkeypatch):
    cv2 = double_of_opencv([np.repeat(LEVELS[::-1, :, None], 3, axis=2)])
    monkeypatch.setitem(sys.modules, "cv2", cv2)
    camera = make_camera("v4l2:0,rate=100,exposure=0.004")
    before = time.perf_counter()
    camera.open()
    frame = soon(camera)
    assert np.array_equal(frame.pieces[0].levels, LEVELS)
    assert before - 0.002 <= frame.time <= time.perf_counter() - 0.002 and frame.exposure == 0.004
    assert not camera.info.met_hardware and not camera.info.stamped
    assert cv2.VideoCapture.asked[1] == 100.0 and cv2.VideoCapture.asked[3] == pytest.approx(40.0)
    with pytest.raises(CameraLost, match="gives no more frames"):
        soon(camera)
    camera.close()
    with pytest.raises(InputError, match="OpenCV cannot open it"):
        make_camera("v4l2:7").open()


def test_a_video_through_opencv_itself(tmp_path):
    """Where OpenCV is installed: a file takes the place of the device, and its frames come up to what coding loses."""
    cv2 = pytest.importorskip("cv2", reason="OpenCV is not installed: pip install 'otwarp[cameras]'")
    file = tmp_path / "frames.avi"
    rows, columns = np.indices((48, 64))
    levels = (2 * columns + 2 * rows).astype(np.uint8)
    writer = cv2.VideoWriter(str(file), cv2.VideoWriter_fourcc(*"MJPG"), 30.0, (64, 48))
    if not writer.isOpened():
        pytest.skip("this OpenCV writes no videos")
    for _ in range(3):
        writer.write(np.repeat(levels[::-1, :, None], 3, axis=2))
    writer.release()
    camera = make_camera(f"v4l2:{file},rate=100")
    camera.open()
    frame = soon(camera)
    seen = frame.pieces[0].levels
    assert seen.shape == levels.shape and np.abs(seen.astype(int) - levels).max() < 8
    with pytest.raises(CameraLost, match="gives no more frames"):
        while time.perf_counter() < frame.sent + 60.0:
            soon(camera)
    camera.close()
    with pytest.raises(InputError, match="OpenCV cannot open it"):
        make_camera(f"v4l2:{tmp_path / 'absent.avi'}").open()


class Buffer:
    """A filled buffer of the driver of GenICam cameras, upside down, with the time of its light [ns]."""

    def __init__(self, stamp):
        component = SimpleNamespace(data=LEVELS[::-1].ravel(), height=6, width=8, data_format="Mono8")
        self.payload, self.timestamp_ns = SimpleNamespace(components=[component]), stamp

    def __enter__(self):
        return self

    def __exit__(self, *_):
        return None


def harvesters(nodes, waits):
    """The modules of that driver, whose camera has these nodes; its frames come after `waits` [s], with stamps."""

    class Acquirer:
        remote_device = SimpleNamespace(node_map=nodes)

        def start(self):
            pass

        def fetch(self, timeout):
            if not waits:
                time.sleep(0.01)
                raise TimeoutError
            wait, stamp = waits.pop(0)
            time.sleep(wait)
            return Buffer(stamp)

        def destroy(self):
            pass

    class Harvester:
        def add_file(self, file):
            if not file.endswith(".cti"):
                raise FileNotFoundError(file)

        def update(self):
            pass

        def create(self, which):
            return Acquirer()

        def reset(self):
            pass

    core = ModuleType("harvesters.core")
    core.Harvester = Harvester  # type: ignore[attr-defined]
    return {"harvesters": ModuleType("harvesters"), "harvesters.core": core}


def test_a_genicam_camera(monkeypatch):
    """Its stamps are ticks of its own clock: a frame that is held up keeps the time of its light."""
    nodes = SimpleNamespace(AcquisitionFrameRate=SimpleNamespace(value=0.0), ExposureTime=SimpleNamespace(value=0.0))
    for name, module in harvesters(nodes, [(0.0, 7_000_000_000), (0.06, 7_010_000_000)]).items():
        monkeypatch.setitem(sys.modules, name, module)
    camera = make_camera("genicam:0,cti=vendor.cti,exposure=0.002,rate=100")
    camera.open()
    first, second = soon(camera), soon(camera)
    assert nodes.ExposureTime.value == pytest.approx(2000.0) and nodes.AcquisitionFrameRate.value == 100.0
    assert np.array_equal(first.pieces[0].levels, LEVELS)
    assert second.time - first.time == pytest.approx(0.010, abs=1e-6)
    assert second.sent - second.time > 0.03
    camera.close()
    with pytest.raises(InputError, match="cannot be opened"):
        make_camera("genicam:0,cti=vendor.so").open()


def test_a_genicam_clock_that_drifts_or_is_set_anew_is_followed():
    """The quickest frame of the last seconds says what it shows; one of an hour ago knows nothing of a slow one."""
    camera = GenicamCamera("0", cti="vendor.cti")
    drift, way = 1e-3, [0.004, 0.001, 0.006]
    for n in range(4000):
        came = 0.01 * n
        true = came - way[n % 3]
        light = true * (1.0 - drift) + camera._offset(came, came - true * (1.0 - drift))
        assert -1e-3 - drift * CLOCK_OVER - 0.006 < light - came <= 0.0, n
    # set back by 100 s: believed again once the frames of the old clock are that old
    ticks = [(came, came - 100.0 + camera._offset(came, 100.0)) for came in (40.0, 41.0, 40.0 + 2.0 * CLOCK_OVER)]
    assert ticks[0][1] < -50.0 and ticks[2][1] == pytest.approx(ticks[2][0])


@pytest.mark.thorough
def test_opencv_says_nothing_beside_our_line(tmp_path):
    """In a process of its own, as OpenCV reads when it is imported what it may say."""
    pytest.importorskip("cv2", reason="OpenCV is not installed: pip install 'otwarp[cameras]'")
    (tmp_path / "text.mp4").write_text("no video " * 100, encoding="utf-8")
    code = (
        "import sys\nfrom otwarp.errors import InputError\nfrom otwarp.perception.kinds import make_camera\n"
        "try: make_camera(sys.argv[1]).open()\nexcept InputError as error: print(error)"
    )
    plain = {name: value for name, value in os.environ.items() if not name.startswith("OPENCV_")}
    for spec, said in (("v4l2:97", "OpenCV cannot open it"), (f"files:{tmp_path / 'text.mp4'}", "no frames in it")):
        line = [sys.executable, "-c", code, spec]
        ended = subprocess.run(line, capture_output=True, text=True, check=True, env=plain)
        assert said in ended.stdout and not ended.stderr
