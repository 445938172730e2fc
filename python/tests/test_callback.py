"""The callback of a rendering, Ctrl-C, and other threads."""

from __future__ import annotations

import pathlib
import signal
import subprocess
import sys
import threading
import time
from typing import Any, Dict, List, Tuple

import numpy as np
import pytest

import lumiris
from conftest import SCENE


def test_every_pass_is_told_with_its_image() -> None:
    told: List[Tuple[int, float, np.ndarray]] = []

    def callback(progress: lumiris.Progress) -> None:
        if progress.is_pass:
            told.append((progress.passes, progress.fraction, progress.image()))
            assert progress.layers().keys() == {"beauty", "albedo", "normal", "depth", "samples"}

    image = lumiris.render(SCENE, spp=16, callback=callback)
    assert [passes for passes, _, _ in told] == [1, 2, 3]
    assert [fraction for _, fraction, _ in told] == [1 / 16, 1 / 4, 1.0]
    assert np.array_equal(told[-1][2], image["beauty"])
    # The image of a pass contains its samples only
    assert np.array_equal(told[1][2], lumiris.render(SCENE, spp=4)["beauty"])
    assert not np.array_equal(told[0][2], told[1][2])


def test_false_ends_the_rendering_after_the_pass() -> None:
    image = lumiris.render(SCENE, spp=64, allocation="uniform", callback=lambda progress: progress.passes < 3)
    assert not image.complete and image.metadata["lumiris:complete"] == "false"
    assert (image["samples"] == 16).all()
    assert np.array_equal(image["beauty"], lumiris.render(SCENE, spp=16)["beauty"])


def test_progress_within_passes_is_told_from_time_to_time() -> None:
    told: List[Tuple[bool, float, float]] = []
    callback = lambda p: told.append((p.is_pass, p.fraction, p.elapsed))  # noqa: E731
    options: Dict[str, Any] = {"spp": 8, "resolution": (400, 300), "threads": 1, "estimator": "mc"}
    lumiris.render(SCENE, **options, interval=0.01, callback=callback)
    assert sum(not is_pass for is_pass, _, _ in told) >= 3
    fractions = [fraction for _, fraction, _ in told]
    assert fractions == sorted(fractions) and fractions[-1] == 1.0
    assert all(later >= sooner for (_, _, sooner), (_, _, later) in zip(told, told[1:]))


def test_exceptions_of_the_callback_are_raised() -> None:
    calls = []

    def callback(progress: lumiris.Progress) -> None:
        calls.append(progress)
        raise KeyError("no more")

    with pytest.raises(KeyError, match="no more"):
        lumiris.render(SCENE, spp=1024, resolution=(200, 200), estimator="mc", callback=callback)
    assert len(calls) == 1
    # A stored progress object remains readable
    assert calls[0].image().shape == (200, 200, 3)


def test_other_threads_run_meanwhile() -> None:
    ended = threading.Event()
    turns = 0

    def turn() -> None:
        nonlocal turns
        while not ended.is_set():
            turns += 1
            time.sleep(0.001)

    thread = threading.Thread(target=turn)
    thread.start()
    before, start = turns, time.monotonic()
    lumiris.render(SCENE, spp=32, resolution=(300, 300), estimator="mc")
    done, elapsed = turns - before, time.monotonic() - start
    ended.set()
    thread.join()
    # With the GIL held there would be at most one
    assert done >= 10 * elapsed and done > 3, f"{done} turns in {elapsed:.2f} s"


def test_renderings_run_side_by_side() -> None:
    images: List[lumiris.Rendering] = []
    render = lambda: images.append(lumiris.render(SCENE, spp=8, callback=lambda _: None))  # noqa: E731
    threads = [threading.Thread(target=render) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(images) == 3 and all(np.array_equal(image["beauty"], images[0]["beauty"]) for image in images)


@pytest.mark.parametrize("callback", ["None", "lambda progress: None"])
def test_control_c_ends_the_rendering(scene_file: pathlib.Path, callback: str) -> None:
    script = f"""
import lumiris, signal, threading
# As at a terminal: shells let programs in the background ignore the signal
signal.signal(signal.SIGINT, signal.default_int_handler)
# Says that the rendering is on its way
threading.Timer(0.5, lambda: print("started", flush=True)).start()
try:
    lumiris.render({str(scene_file)!r}, spp=10_000_000, resolution=(400, 300), estimator='mc', callback={callback})
except KeyboardInterrupt:
    print("interrupted")
"""
    with subprocess.Popen([sys.executable, "-c", script], cwd=scene_file.parent, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "started\n"
        process.send_signal(signal.SIGINT)
        start = time.monotonic()
        try:
            rest, _ = process.communicate(timeout=60)
        finally:
            process.kill()
    assert rest == "interrupted\n"
    assert time.monotonic() - start < 20, "tiles under way take a fraction of a second"
