/* Runs the model and writes its outputs as a table: example [T_END [STEPS]]. */

#include <stdio.h>
#include <stdlib.h>
#include "dap3d.h"

int main(int count, char **words)
{
    double t_end = count > 1 ? atof(words[1]) : @T_END@;
    int steps = count > 2 ? atoi(words[2]) : 100;
    dap3d_model *m = dap3d_create(t_end);
    if (m == NULL || steps < 1) {
        fprintf(stderr, "example [T_END [STEPS]]\n");
        return 2;
    }
    for (int v = 0; v < dap3d_count(); v++)
        if (dap3d_kind(v) == DAP3D_TIME || dap3d_kind(v) == DAP3D_OUTPUT)
            printf("%s%s", v > 0 ? "," : "", dap3d_name(v));
    printf("\n");
    for (int k = 0; k <= steps; k++) {
        int result = dap3d_step_to(m, k == steps ? t_end : t_end / steps * k);
        if (result < 0) {
            fprintf(stderr, "%s\n", dap3d_message(m));
            dap3d_free(m);
            return 1;
        }
        for (int v = 0; v < dap3d_count(); v++)
            if (dap3d_kind(v) == DAP3D_TIME || dap3d_kind(v) == DAP3D_OUTPUT)
                printf("%s%.17g", v > 0 ? "," : "", dap3d_get(m, v));
        printf("\n");
        if (result == DAP3D_ENDED)
            break;
    }
    dap3d_free(m);
    return 0;
}
