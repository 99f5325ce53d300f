/* Steps of an exported model at a rate: sorted times in microseconds, of the wall and of the CPU.

   Every pass is the same run, so a step's least time over the passes is its own, and the rest is
   the machine's: real_time T_END RATE PASSES. */
#define _POSIX_C_SOURCE 199309L
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include "dap3d.h"

static double now(clockid_t clock)
{
    struct timespec t;
    clock_gettime(clock, &t);
    return 1e6 * (double)t.tv_sec + 1e-3 * (double)t.tv_nsec;
}

static int order(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static void print(const char *name, double *took, int count)
{
    qsort(took, (size_t)count, sizeof *took, order);
    printf("%s %g %g %g\n", name, took[count / 2], took[count - 1 - count / 10000], took[count - 1]);
}

int main(int argc, char **argv)
{
    double t_end = argc > 1 ? atof(argv[1]) : 60.0, rate = argc > 2 ? atof(argv[2]) : 1000.0;
    int passes = argc > 3 ? atoi(argv[3]) : 5, count = (int)(t_end * rate + 0.5);
    double *wall = malloc(3 * (size_t)count * sizeof *wall), *cpu = wall + count, *own = cpu + count;
    dap3d_model *m = dap3d_create(t_end);
    for (int pass = 0; pass < passes; pass++) {
        dap3d_reset(m);
        for (int k = 0; k < count; k++) {
            double w = now(CLOCK_MONOTONIC), c = now(CLOCK_THREAD_CPUTIME_ID);
            if (dap3d_step_to(m, k + 1 == count ? t_end : (k + 1) / rate) < 0)
                return printf("%s\n", dap3d_message(m)), 1;
            cpu[k] = now(CLOCK_THREAD_CPUTIME_ID) - c;
            wall[k] = now(CLOCK_MONOTONIC) - w;
            own[k] = pass && own[k] < cpu[k] ? own[k] : cpu[k];
        }
    }
    print("wall", wall, count); /* of the last pass */
    print("cpu", cpu, count);
    print("own", own, count);
    dap3d_free(m);
    free(wall);
    return 0;
}
