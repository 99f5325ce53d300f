"""``dap3d kinematics`` and ``dap3d inverse`` as a user meets them."""

import json

import attrs
import numpy as np
import pytest
from support import one_freedom

import dap3d_core as dap


def press(folder):
    """A driven slider-crank in a file."""
    scene = one_freedom.slider_crank_scene(0.3, (0.0, 5.0, 0.0))
    scene.simulation = attrs.evolve(scene.simulation, t_end=0.5, dt=0.05)
    scene.save(folder / "press.toml")
    return scene


@pytest.mark.slow
def test_kinematics_and_inverse_dynamics_follow_each_other(dap3d):
    """The forces of the motion that kinematics has written are its own; from its table as well."""
    press(dap3d.folder)
    done = dap3d.succeed("kinematics", "press.toml")
    assert "press-kinematics.nc written" in done.stdout
    done = dap3d.succeed("inverse", "press.toml", "press-kinematics.nc", "--json")
    assert json.loads(done.stdout)["file"] == "press-inverse.nc"
    motion, forces = (dap.open(dap3d.folder / f"press-{name}.nc") for name in
                      ("kinematics", "inverse"))  # fmt: skip
    assert np.allclose(forces.Lam, motion.Lam, rtol=1e-10, atol=1e-10)
    table = np.column_stack([motion.t, motion.r[:, 0, 0], motion.r[:, 0, 2]])
    np.savetxt(dap3d.folder / "motion.csv", table, delimiter=",", comments="",
               header="t [s],crank.r.x [m],crank.r.z [m]")  # fmt: skip
    done = dap3d.succeed("inverse", "press.toml", "motion.csv", "--actuators", "motor", "--force")
    assert "dap3d plot press-inverse.nc motor.actuation\n" in done.stdout  # what to look at next
    done = dap3d("plot", "press-inverse.nc", "motor.actuation", "-o", "a.png")
    assert (dap3d.folder / "a.png").exists(), done.stderr


def test_a_dead_point_saves_what_was_found_before(dap3d):
    """Exit code 3, the message once, and a result up to there."""
    scene = press(dap3d.folder)
    del scene.joints["motor"]
    scene.add_joint("drive-tran", "ram", P_i="slider.O", P_j="guide", a_j="ground.x",
                    function="turning")  # fmt: skip
    scene.save(dap3d.folder / "press.toml", force=True)
    done = dap3d("kinematics", "press.toml", "--over", "ram.q=0:1:101", "-o", "a.nc")
    assert done.returncode == 3
    assert "dead point at ram.q = 0.0" in " ".join(done.stderr.split())
    assert "up to ram.q = 0 m, is in a.nc" in " ".join(done.stderr.split())
    assert "ram.q = 0 m, 1 instant reported" in done.stdout
    kept = dap.open(dap3d.folder / "a.nc")
    assert kept.status == "stopped"
    assert kept.t[-1] == 0.0


def test_freedoms_left_and_wrong_requests_are_one_message(dap3d, refuse):
    """With the names of the options; nothing is written."""
    press(dap3d.folder)
    done = dap3d("kinematics", "fourbar3")
    assert done.returncode == 1
    assert "coupler turns about" in done.stderr
    assert not list(dap3d.folder.glob("*.nc"))
    assert "--over" in refuse("kinematics", "press.toml", "--over", "moter.q=0:1:3")
    assert "--t-end" in refuse("kinematics", "press.toml", "--t-end", "-1")
    (dap3d.folder / "motion.csv").write_text("t,crank.r.x\n0,0\n1,zero\n", encoding="utf-8")
    assert "motion.csv:3" in refuse("inverse", "press.toml", "motion.csv")
    rows = [f"{t},{0.05 * np.cos(t)}" for t in np.linspace(0.2, 0.5, 7)]
    (dap3d.folder / "motion.csv").write_text("\n".join(["t,crank.r.x", *rows]), encoding="utf-8")
    said = refuse("inverse", "press.toml", "motion.csv", "--actuators", "moter")
    assert "--actuators" in said
    assert "did you mean 'motor'" in said
