"""Exported models in C: real time at 1 kHz, the time of a step over that of Python, sizes."""

import statistics
import subprocess
import tempfile
import time
from pathlib import Path

import dap3d_core as dap
from dap3d_core.native.build import own_platform

#: A run of 60 s at 1 kHz; the program prints the sorted times of its steps in microseconds.
SECONDS, RATE = 60, 1000
PROGRAM = """
#define _POSIX_C_SOURCE 199309L
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include "dap3d.h"
static double took[%(steps)d];
static int order(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}
int main(void)
{
    dap3d_model *m = dap3d_create(%(seconds)d.0);
    for (int k = 1; k <= %(steps)d; k++) {
        struct timespec a, b;
        clock_gettime(CLOCK_MONOTONIC, &a);
        if (dap3d_step_to(m, k == %(steps)d ? %(seconds)d.0 : k / %(rate)d.0) < 0)
            return printf("%%s\\n", dap3d_message(m)), 1;
        clock_gettime(CLOCK_MONOTONIC, &b);
        took[k - 1] = 1e6 * (double)(b.tv_sec - a.tv_sec) + 1e-3 * (double)(b.tv_nsec - a.tv_nsec);
    }
    qsort(took, %(steps)d, sizeof *took, order);
    for (int k = 2; k <= 2000; k *= k == 2 ? 500 : 2) /* median, 99.9 %%, 99.95 %% */
        printf("%%g ", took[%(steps)d - %(steps)d / k]);
    printf("%%g\\n", took[%(steps)d - 1]);
    return 0;
}
"""


def exported(folder, model, **options):
    """A model in C, and the seconds that its export took."""
    start = time.perf_counter()
    made = dap.export_model(model, folder / "model", format="c", force=True, **options)
    return made, time.perf_counter() - start


def real_time():
    """Microseconds of the steps of rk4 of a quarter car at 1 kHz for 60 s."""
    numbers = {"steps": SECONDS * RATE, "seconds": SECONDS, "rate": RATE}
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        made, _ = exported(folder, "quarter_car", integrator="rk4", step=1.0 / RATE, t_end=SECONDS)
        (folder / "real.c").write_text(PROGRAM % numbers)
        [archive] = (made.path / own_platform()).glob("*.a")
        program = folder / "real"
        subprocess.run(["cc", "-O2", "-DDAP3D_STATIC", f"-I{made.path}", folder / "real.c", archive,
                        "-lm", "-o", program], check=True)  # fmt: skip
        done = subprocess.run([program], check=True, capture_output=True, text=True)
    parts = ("median", "99.9 %", "99.95 %", "worst")
    times = map(float, done.stdout.split())
    return [{"part": part, "us": us} for part, us in zip(parts, times, strict=True)]


def _median(step, count):
    """Microseconds of a step."""
    took = []
    for k in range(count):
        start = time.perf_counter()
        step(k)
        took.append(time.perf_counter() - start)
    return 1e6 * statistics.median(took)


def steps(models=("pen1", "crane", "fourbar3", "quarter_car"), count=500, dt=1e-3):
    """Microseconds of a step to the next millisecond, here and in Python; size, time of export."""
    found = []
    for name in models:
        with tempfile.TemporaryDirectory() as scratch:
            exported(Path(scratch), name)  # code is in the cache then
            made, seconds = exported(Path(scratch), name)
            run = dap.load_native(made.path).start(10.0)
            here = dap.start(name, t_end=10.0, record=False)
            times = {"C": _median(lambda k, run=run: run.step_to(dt * (k + 1)), count),
                     "Python": _median(lambda _, run=here: run.step(dt), count)}  # fmt: skip
            found.append({"model": name, **times, "kB": made.size / 1e3, "export_s": seconds})
    return found


if __name__ == "__main__":
    for row in (*real_time(), *steps()):
        print(row)
