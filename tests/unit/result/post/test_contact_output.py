"""Contacts of a result: units of what turns, columns and variables of all of them."""

import numpy as np
import pytest
from support.internals import columns_of, dataset_to_write

import dap3d_core as dap
from dap3d_core.cli import main
from dap3d_core.result import UnknownNameError, names_of


@pytest.fixture(scope="module")
def result():
    """A wheel that turns to its stop in a hinge that rubs, and a ball that slides."""
    scene = dap.Scene(name="wheel and ball")
    scene.add_body("wheel", mass=2.0, Jp=[0.5, 0.5, 0.3], w=[0.0, 0.0, 2.0])
    scene.add_body("ball", mass=2.0, Jp=[0.008] * 3, r=[3.0, 0.0, 0.1], r_dot=[1.0, 0.0, 0.0])
    axle = {"P_i": "wheel.O", "P_j": "ground.O", "a_i": "wheel.z", "a_j": "ground.z"}
    scene.add_joint("rev", "axle", **axle, upper=0.3, e=0.0)
    scene.add_force("rot_friction", "rub", joint="axle", n_c=0.3)
    scene.add_force("ptp", "spring", P_i="ball.O", P_j="ground.O", k=1.0)
    scene.add_force("weight", "weight")
    scene.add_contact("ball_plane", "floor", P_i="ball.O", radius=0.1, mu=0.3)
    return dap.simulate(scene, t_end=0.3, dt=0.05)


def test_what_turns_has_units_of_angles_and_moments(result):
    """Of the limit of an angle, friction of a hinge, and a ball on a plane."""
    limit, rub, floor = (result.contact(n).units for n in ("axle_upper", "rub", "floor"))
    assert [limit[n] for n in ("gap", "normal_force", "slip")] == ["rad", "N m", "rad/s"]
    assert [rub[n] for n in ("normal_force", "friction", "slip")] == ["N", "N m", "rad/s"]
    assert [floor[n] for n in ("gap", "normal_force", "friction", "slip")] == ["m", "N", "N", "m/s"]
    assert result.quantity("axle_upper.normal")[1:] == ("moment of axle_upper", "N m")
    assert result.quantity("rub.slip.z").unit == "rad/s"
    assert result.quantity("floor.normal")[1:] == ("normal force of floor", "N")


def test_points_of_one_contact_may_have_units_of_their_own():
    """Friction of a rod that slides (rub#1) and turns (rub#2)."""
    scene = dap.Scene(name="rod")
    scene.add_body("rod", mass=2.0, Jp=[0.5, 0.5, 0.3], r_dot=[0, 0, 1.0], w=[0, 0, 2.0])
    axle = {"P_i": "rod.O", "P_j": "ground.O", "a_i": "rod.z", "a_j": "ground.z"}
    scene.add_joint("cyl", "axle", **axle)
    scene.add_force("friction", "rub", joint="axle", mu=0.1, radius=0.02)
    rub = dap.simulate(scene, t_end=0.1, dt=0.05)
    assert [rub.contact(f"rub#{k}").units["slip"] for k in (1, 2)] == ["m/s", "rad/s"]
    assert rub.contact("rub").units["slip"] == "SI"


def test_tables_have_columns_of_contacts(result):
    """Each is the quantity of its name; multipliers are those of joints alone."""
    columns = {c.name: c for c in columns_of(result)}
    assert [columns[f"{n}.gap"].unit for n in ("floor", "axle_upper", "rub")] == ["m", "rad", "rad"]
    for name in ("floor.normal", "floor.slip.x", "rub.friction.z", "axle_upper.mode"):
        values, _, unit = result.quantity(name)
        np.testing.assert_array_equal(columns[name].values, values)
        assert columns[name].unit == unit
    assert {n.split(".")[0] for n in columns if ".lambda." in n} == {"axle"}
    assert not any(
        n.startswith("floor") for n in (c.name for c in columns_of(result, reactions=False))
    )


def test_data_sets_have_variables_of_contacts(result):
    dataset = dataset_to_write(result)
    assert dataset.contact.values.tolist() == ["floor", "axle_upper", "rub"]
    assert dataset.contact_turns.values.tolist() == [0, 1, 1]
    assert dataset.contact_gap.attrs["units"] == "SI"
    np.testing.assert_array_equal(dataset.contact_slip[:, 0], result.contact("floor").slip)
    np.testing.assert_array_equal(dataset.contact_mode[:, 2], result.contact("rub").mode)


def test_contacts_are_no_joints(result):
    assert list(result.reactions()) == ["axle"]
    assert {n.removeprefix("floor.") for n in names_of(result, "floor.")} == {
        "gap", "normal", "friction", "slip", "mode"
    }  # fmt: skip
    assert names_of(result, "floor.slip.") == [f"floor.slip.{n}" for n in ("x", "y", "z", "norm")]
    with pytest.raises(UnknownNameError, match=r"did you mean 'floor\.gap'"):
        result.quantity("flor.gap")
    with pytest.raises(UnknownNameError, match="is a contact"):
        result.reaction("floor")


def test_commands_take_results_whose_rows_are_those_of_contacts_alone(tmp_path, capfd):
    """post, export and info of a ball on a plane."""
    scene = dap.Scene(name="ball")
    scene.add_body("ball", mass=2.0, Jp=[0.008] * 3, r=[0.0, 0.0, 0.1], r_dot=[1.0, 0.0, 0.0])
    scene.add_force("weight", "weight")
    scene.add_contact("ball_plane", "floor", P_i="ball.O", radius=0.1, mu=0.3)
    file, table = str(tmp_path / "ball.nc"), tmp_path / "a.csv"
    dap.simulate(scene, t_end=0.2, dt=0.1).save(file)
    for command, target in (("post", tmp_path / "a.nc"), ("post", table), ("export", "a.mat")):
        assert main([command, file, "-o", str(tmp_path / target)]) == 0
    assert "floor.normal [N]" in table.read_text().splitlines()[0]
    capfd.readouterr()
    assert main(["info", file]) == 0
    text = capfd.readouterr().out
    assert "joints" not in text
    assert "contacts     floor" in text


def test_forces_are_unknown_where_velocities_jump(result):
    """Curves end before an impact and begin behind it: the state there is known, forces are not."""
    from support.internals import smooth_parts

    before, behind = smooth_parts(result)
    for part, place in ((before, -1), (behind, 0)):
        for name in ("floor", "rub", "axle_upper"):
            contact = part.contact(name)
            assert np.isnan([contact.normal_force[place], *contact.friction[place]]).all()
            assert np.isfinite(contact.slip[place]).all()
        assert np.isfinite(part.contact("floor").normal_force).sum() == len(part.t) - 1


def test_info_names_shapes_that_meet(tmp_path, capfd, monkeypatch):
    """With the number of rows of their table; tolerances by quantity are words, no code."""
    monkeypatch.setenv("COLUMNS", "60")
    scene = dap.Scene(name="ball")
    scene.add_body("ball", mass=2.0, Jp=[8e-7] * 3, r=[0.0, 0.0, 0.001])
    scene.add_shape("sphere", "marble", body="ball", radius=0.001, collides=True)
    scene.add_shape("plane", "ground_plane", body="ground", collides=True)
    scene.add_force("weight", "weight")
    scene.add_material("wood", mu=0.3)
    scene.add_collisions(material="wood")
    file = str(tmp_path / "ball.nc")
    dap.simulate(scene, t_end=0.02, dt=0.01, contact_step=1e-3).save(file)
    assert main(["info", file]) == 0
    text = capfd.readouterr().out
    assert "shapes       marble, ground_plane" in text
    assert "met          at 2 points at reported instants" in text
    assert "{" not in text
    assert max(map(len, text.splitlines())) <= 60


def test_check_and_describe_name_contacts(tmp_path, capfd):
    """Each once, however many points it has, apart from joints."""
    scene = dap.Scene(name="box")
    scene.add_body("box", mass=2.0, Jp=[0.01] * 3, r=[0.0, 0.0, 0.1])
    scene.add_contact("box_plane", "floor", P_i="box.O", size=[0.2, 0.2, 0.2], mu=0.3)
    file = tmp_path / "box.toml"
    scene.save(file)
    for command, text in (("check", "1 box_plane"), ("describe", "floor (box_plane)")):
        assert main([command, str(file)]) == 0
        assert f"contacts  {text}" in capfd.readouterr().out.replace("   ", "  ")
