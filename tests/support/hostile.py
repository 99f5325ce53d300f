"""Scenes from somebody who means harm: names, texts and colours that try to be something else."""

import json
from pathlib import Path

#: Stands in every text below: where it turns up as code, a text of a scene has become one.
MARK = "pwned"
#: What a body, a point or a joint may be called; each tries to break out of something.
NAMES = (
    f"</script><script>{MARK}=1</script>",
    f'" onmouseover="{MARK}=1',
    f"' onload='{MARK}=1",
    f"<img src=x onerror={MARK}=1>",
    "<!--<script>",
    "{{data}}${alert(1)}{{",
    f"[red]{MARK}[/red]",
    f"$(touch {MARK});`touch {MARK}`|&",
    f"=cmd|{MARK}!A0",
    r"$\frac{1}{$ _^",
    "&lt;script&gt;",
    "javascript:alert(1)",
    "__proto__",
    "%s %(x)s %n {0} {x!r}",
    "../../etc/passwd".replace(".", "_"),
    f'"""\\"+__import__("os")+{MARK}',
)
#: Moves a cursor, names a window, turns a line around, forges a line.
ESCAPES = (
    "x</script>\x1b[31mred\x1b]0;title\x07\u202edesrever\r\u2028\u2029\x9b2J\nno mistakes found"
)
COLORS = ("red;background:url(http://x)", '"><script>', "url(javascript:1)", "expression(1)")


def quoted(text):
    """A text as TOML writes it."""
    return json.dumps(text).replace("\x7f", "\\u007f")


def text_of_scene(names=NAMES, title=ESCAPES, more=""):
    """A scene that is right, and whose texts are these."""
    lines = ["[scene]", f"name = {quoted(title)}", f"description = {quoted(title)}"]
    for k, name in enumerate(names):
        lines += [f"[bodies.{quoted(name)}]", "mass = 1.0", "Jp = [1.0, 1.0, 1.0]"]
        lines += [f"r = [{float(k)}, 0.0, 0.0]", f"color = {quoted(COLORS[k % len(COLORS)])}"]
        lines += [f"[points.{quoted(name)}]", f"body = {quoted(name)}", "sPp = [0.0, 0.0, 0.1]"]
    first = quoted(names[0])
    lines += ["[points.hook]", 'body = "ground"', "sPp = [0.0, 0.0, 0.1]"]
    lines += [f"[joints.{first}]", 'type = "sph"', f"P_i = {first}", 'P_j = "hook"']
    lines += [f"[forces.{first}]", 'type = "weight"']
    lines += [f"[shapes.{first}]", 'type = "sphere"', f"body = {first}", "radius = 0.1"]
    lines += [f"color = {quoted(COLORS[0])}"]
    lines += ["[simulation]", "t_end = 0.02", "dt = 0.01", 'integrator = "rk4"', "step = 0.01"]
    return "\n".join(lines) + "\n" + more


def write(folder: Path, text=None):
    """A folder with this scene in it; returns the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "scene.toml").write_text(text or text_of_scene(), encoding="utf-8")
    return folder
