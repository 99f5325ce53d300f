"""Runs that are ended on their way, and leave a checkpoint."""

import math

import pytest

import dap3d_core as dap


class EndedError(Exception):
    """What ends a run here."""


def shorten_chunks(monkeypatch):
    """As many chunks as there are steps."""
    monkeypatch.setattr("dap3d_core.simulation.run.CHUNK_SECONDS", 1e-9)
    monkeypatch.setattr("dap3d_core.simulation.run.FIRST_CHUNK", 1)


def ended_at(t):
    """Watches a run and ends it at t."""

    def watch(standing):
        if standing.t >= t:
            raise EndedError

    return watch


def leave(scene, folder, t, **settings):
    """End a run at t; its checkpoint."""
    with pytest.raises(EndedError) as caught:
        dap.simulate(
            scene, output=folder / "run.nc", watch=ended_at(t), checkpoint=math.inf, **settings
        )
    assert caught.value.checkpoint == folder / "run.nc.checkpoint"
    assert 0.0 < caught.value.result.t[-1] <= settings["t_end"]
    return caught.value.checkpoint
