"""The line on stderr while kernels compile, by numba's own event."""

from numba import njit

from airtruth.cli.progress import announced_compilation


def test_compilation_is_stated_once(capsys):
    with announced_compilation("trace", quiet=False):
        njit(lambda x: x + 1.0)(1.0)
        njit(lambda x: x + 2.0)(1.0)
    assert capsys.readouterr().err == (
        "airtruth trace: compiles its kernels; later runs read them from the cache\n"
    )


def test_compiled_kernels_and_quiet_runs_state_nothing(capsys):
    kernel = njit(lambda x: x + 1.0)
    with announced_compilation("trace", quiet=True):
        kernel(1.0)
    with announced_compilation("trace", quiet=False):
        kernel(1.0)
    assert capsys.readouterr().err == ""
