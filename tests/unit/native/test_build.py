"""Exported libraries by themselves: without Python, in threads, on other platforms."""

import os
import shutil
import subprocess
import sys

import numpy as np
import pytest
from support.binaries import macho_names, pe_names
from support.process import REPOSITORY

import dap3d_core as dap
from dap3d_core.kernels.runtime import ready
from dap3d_core.native import build
from dap3d_core.native.beside import compile_modules
from dap3d_core.native.export import model_of

sys.path.append(str(REPOSITORY / "tools"))
from ready_objects import pack_of

THREADS = """
#include <pthread.h>
#include <stdio.h>
#include <string.h>
#include "dap3d.h"
#define COUNT 100
static double found[COUNT];
static void *work(void *first)
{
    for (int k = *(int *)first; k < COUNT; k += 8) {
        dap3d_model *m = dap3d_create(0.5), *other = dap3d_create(0.5);
        static _Thread_local char state[1 << 20];
        if (dap3d_state_size() > sizeof state)
            return NULL;
        for (int i = 1; i <= 10; i++) {
            dap3d_step_to(m, i < 10 ? 0.05 * i : 0.5);
            if (i == 5) {
                dap3d_save(m, state);
                dap3d_load(other, state);
            }
            if (i > 5)
                dap3d_step_to(other, i < 10 ? 0.05 * i : 0.5);
        }
        found[k] = dap3d_get(m, dap3d_find("cone.r.z"));
        if (found[k] != dap3d_get(other, dap3d_find("cone.r.z")))
            found[k] = 0.0;
        dap3d_free(m);
        dap3d_free(other);
    }
    return NULL;
}
int main(void)
{
    pthread_t threads[8];
    int first[8];
    for (int k = 0; k < 8; k++) {
        first[k] = k;
        pthread_create(threads + k, NULL, work, first + k);
    }
    for (int k = 0; k < 8; k++)
        pthread_join(threads[k], NULL);
    for (int k = 0; k < COUNT; k++)
        if (found[k] != found[0] || found[k] == 0.0)
            return 1;
    printf("%a", found[0]);
    return 0;
}
"""


def exported(folder, **options):
    return dap.export_model("pen1", folder / "out", format="c", force=True, **options)


def compiler():
    found = next((c for c in ("gcc", "cc", "clang") if shutil.which(c)), None)
    if found is None or not sys.platform.startswith("linux"):
        pytest.skip("needs a C compiler on Linux")
    return found


@pytest.mark.slow
def test_a_hundred_runs_in_eight_threads_are_clean_under_sanitizers(tmp_path, monkeypatch):
    run = dap.load_native(exported(tmp_path).path).start(0.5)
    for k in range(1, 11):
        run.step_to(0.05 * k if k < 10 else 0.5)
    (tmp_path / "threads.c").write_text(THREADS)
    monkeypatch.setattr(build.importlib.util, "find_spec", lambda name: None)
    options = build.OPTIONS
    for sanitizer in ("address,undefined", "thread"):
        # the runtime as well as the program
        monkeypatch.setattr(build, "OPTIONS", (*options, f"-fsanitize={sanitizer}"))
        made = exported(tmp_path)
        archive = made.path / build.own_platform() / "libpen1.a"
        program = tmp_path / sanitizer
        command = [compiler(), "-std=c11", "-g", f"-fsanitize={sanitizer}", "-DDAP3D_STATIC",
                   f"-I{made.path}", tmp_path / "threads.c", archive, "-lm", "-lpthread",
                   "-o", program]  # fmt: skip
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode and "cannot find" in done.stderr:
            pytest.skip("there are no sanitizers")
        assert not done.returncode, done.stderr
        ran = subprocess.run([program], capture_output=True, text=True, check=False)
        if "unexpected memory mapping" in ran.stderr:
            continue  # the sanitizer does not fit the kernel
        assert (ran.returncode, ran.stderr) == (0, "")
        assert float.fromhex(ran.stdout) == run["cone.r.z"]


@pytest.mark.slow
def test_it_runs_in_an_empty_root(tmp_path):
    made = exported(tmp_path)
    root = tmp_path / "root"
    root.mkdir()
    archive = made.path / build.own_platform() / "libpen1.a"
    command = [compiler(), "-static", "-DDAP3D_STATIC", made.path / "example.c", archive, "-lm",
               "-o", root / "example"]  # fmt: skip
    if subprocess.run(command, capture_output=True, check=False).returncode:
        pytest.skip("there is no static C library")
    inside = ["unshare", "--user", "--map-root-user", "chroot", root, "/example", "0.5", "4"]
    if shutil.which("unshare") is None:
        pytest.skip("there is no unshare")
    done = subprocess.run(inside, capture_output=True, text=True, check=False)
    if "Operation not permitted" in done.stderr or "unshare failed" in done.stderr:
        pytest.skip("no namespace of users is allowed")
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.splitlines()) == 6


@pytest.mark.slow
def test_the_shared_library_needs_the_c_library_alone(tmp_path, optimised_libraries):
    """And has the bits of a run, optimised as it is."""
    if shutil.which("readelf") is None:
        pytest.skip("there is no readelf")
    made = exported(tmp_path)
    run = dap.load_native(made.path).start(0.5)
    run.step_to(0.5)
    result = dap.simulate("pen1", t_end=0.5, dt=0.5)
    assert [run[f"cone.r.{axis}"] for axis in "xyz"] == result.r[-1, 0].tolist()
    library = made.path / build.own_platform() / "libpen1.so"
    listed = subprocess.run(["readelf", "-dW", library], capture_output=True, text=True, check=True)
    needed = {line.split("[")[1].rstrip("]") for line in listed.stdout.splitlines()
              if "(NEEDED)" in line}  # fmt: skip
    assert needed <= {"libc.so.6", "libm.so.6", "ld-linux-x86-64.so.2", "ld-linux-aarch64.so.1"}
    symbols = subprocess.run(["readelf", "--dyn-syms", "-W", library], capture_output=True,
                             text=True, check=True)  # fmt: skip
    own = {words[7] for words in map(str.split, symbols.stdout.splitlines())
           if len(words) == 8 and words[4] == "GLOBAL" and words[6] != "UND"}  # fmt: skip
    assert "dap3d_step_to" in own
    assert all(name.startswith("dap3d_") for name in own)
    assert "dap3d_outputs" not in own
    assert made.size < 400_000


@pytest.mark.slow
def test_files_are_equal_where_objects_are_ready_made(tmp_path, monkeypatch):
    """Nothing is compiled then but what belongs to the scene, its outputs."""
    monkeypatch.setenv("DAP3D_READY_LEVEL", "0")
    monkeypatch.setattr(build, "cache_folder", lambda: None)
    made = {}
    for whence in ("compiled", "ready-made"):
        compiled = []

        def noted(modules, target, compiled=compiled):
            compiled.extend(modules)
            compile_modules(modules, target)

        monkeypatch.setattr(build, "compile_modules", noted)
        out = exported(tmp_path)
        files = sorted(path for path in out.path.rglob("*") if path.is_file())
        made[whence] = [path.read_bytes() for path in files], len(compiled)
        modules = [(name, build.module_of(unit, tmp_path)) for unit in model_of("pen1").units
                   if (name := build.ready_name(unit))]  # fmt: skip
        linked = {name: (module.text, module.level) for name, module in modules}
        monkeypatch.setattr(ready, "FOLDER", tmp_path)
        content, count = pack_of(build.own_platform(), {}, linked)
        (tmp_path / f"{build.own_platform()}.pack").write_bytes(content)
        ready._pack.cache_clear()
    ready._pack.cache_clear()
    assert count == len(linked)
    assert made["ready-made"][0] == made["compiled"][0]
    assert made["ready-made"][1] == 2 < made["compiled"][1]


def test_without_a_compiler_it_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(build.shutil, "which", lambda name: None)
    monkeypatch.setattr(build.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(dap.SceneError, match=r"no C compiler\s+pip install ziglang"):
        exported(tmp_path)


def test_the_compiler_of_a_machine_is_for_its_own_platform(tmp_path, monkeypatch):
    found = compiler()
    monkeypatch.setattr(build.shutil, "which", lambda name: found)
    monkeypatch.setattr(build.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(dap.SceneError, match="no libraries for windows-x86-64"):
        exported(tmp_path, platforms=["windows"])
    assert exported(tmp_path).platforms == (build.own_platform(),)


@pytest.mark.slow  # the first one makes the C libraries of the systems, some minutes
@pytest.mark.parametrize(
    ("platform", "begin"),
    [
        ("linux-arm64", b"\x7fELF"),
        ("windows-x86-64", b"MZ"),
        ("macos-x86-64", b"\xcf\xfa\xed\xfe"),
        ("macos-arm64", b"\xcf\xfa\xed\xfe"),
    ],
)
def test_libraries_of_other_platforms_are_linked_here(tmp_path, platform, begin):
    pytest.importorskip("ziglang")
    made = exported(tmp_path, platforms=[platform])
    library = next((made.path / platform).glob("*pen1.[sd][oly]*"))
    content = library.read_bytes()
    assert content.startswith(begin)
    assert b"dap3d_step_to" in content
    if platform.startswith("windows"):
        libraries, names = pe_names(content)
        system = {"kernel32.dll", "msvcrt.dll", "ucrtbase.dll"}
        assert all(n in system or n.startswith("api-ms-win-crt-") for n in libraries)
    elif platform.startswith("macos"):
        libraries, names = macho_names(content)
        assert libraries == ["/usr/lib/libSystem.B.dylib"]
        linker = {"__mh_dylib_header", "___dso_handle"}  # those of any library
        names = [name.removeprefix("_") for name in names if name not in linker]
    else:
        return
    assert "dap3d_step_to" in names
    assert all(name.startswith("dap3d_") for name in names)
    assert "dap3d_outputs" not in names
    assert (made.path / platform / "libpen1.a").exists()


@pytest.mark.slow  # the C library of Windows is made first, some minutes
def test_a_program_for_windows_prints_under_wine_what_one_for_linux_does(tmp_path):
    """Equal but for the last bits of sines and cosines, of which each C library has its own."""
    pytest.importorskip("ziglang")
    wine = shutil.which("wine64") or shutil.which("wine")
    if wine is None:
        pytest.skip("there is no wine")
    made = exported(tmp_path, platforms=[build.own_platform(), "windows"])
    tables = []
    for name in made.platforms:
        zig, program = build.PLATFORMS[name].zig, tmp_path / f"{name}.exe"
        given = "-DDAP3D_STATIC", made.path / "example.c", made.path / name / "libpen1.a"
        command = [sys.executable, "-m", "ziglang", "cc", "-target", zig, *given, "-lm", "-o"]
        subprocess.run([*command, program], check=True)
        loader = [wine] if name.startswith("windows") else []
        prefix = os.environ | {"WINEPREFIX": str(tmp_path / "wine"), "WINEDEBUG": "-all"}
        done = subprocess.run([*loader, program, "0.5", "10"], env=prefix, capture_output=True,
                              text=True, check=True)  # fmt: skip
        tables.append([line.split(",") for line in done.stdout.splitlines()])
    (head, *rows), (names, *found) = tables
    assert names == head
    # rounding of numbers up to 10, in some 100 steps
    np.testing.assert_allclose(np.array(found, float), np.array(rows, float), rtol=0, atol=1e-12)
