"""Errors of results against references, as functions of a result."""

import tomllib

import numpy as np

import dap3d_core as dap
from hard import references
from hard.case import relative_error


def first_body(result):
    """(nt, 4) x, y, vx, vy of the first body."""
    return np.hstack([result.r[:, 0, :2], result.rd[:, 0, :2]])


def crank_tip(result):
    """(nt, 4) x, y, vx, vy of the end of a crank of 1 m that is the first body, on the origin."""
    return 2.0 * first_body(result)


def at_all_instants(found, reference):
    """Error e of ``found(result)`` against ``reference(t)`` after the start."""
    return lambda result: relative_error(found(result)[1:], reference(result.t)[1:])


def against_digits(model, quantities, units=(1.0, 1.0)):
    """Error e against numbers of a shipped model's ``expected.toml``.

    Args:
        model: its name.
        quantities: of those numbers, "KIND.NAME".
        units: length and time of the scene's units in 1 m and 1 s.
    """
    length, time = units
    scales = {"rP": length, "r": length, "p": 1.0, "w": 1.0 / time}
    checks = tomllib.loads((dap.shipped_models()[model] / "expected.toml").read_text())["check"]
    wanted = [c for c in checks if c["quantity"] in quantities and c.get("t", 0.0) > 0.0]

    def error(result):
        found, expected = [], []
        for check in wanted:
            kind, name = check["quantity"].split(".")
            at = int(np.argmin(np.abs(result.t - check["t"] * time)))
            if abs(result.t[at] / time - check["t"]) > 1e-9:
                continue
            names = result.model.point_names if kind == "rP" else result.model.body_names
            value = np.array(check["value"])
            now = getattr(result, kind)[at, list(names).index(name)] / scales[kind]
            found.append(now * np.sign(now @ value) if kind == "p" else now)  # p, -p: one pose
            expected.append(value)
        return relative_error(np.concatenate(found), np.concatenate(expected))

    return error


def turning(J, w):
    """Error e of omega in body axes and of Euler parameters of a free body."""

    def error(result):
        expected = references.free_body(J, w, result.t)
        p = result.p[:, 0]
        p = p * np.sign(np.sum(p * expected[:, 3:], axis=1, keepdims=True))
        return relative_error(np.hstack([result.wp[:, 0], p])[1:], expected[1:])

    return error
