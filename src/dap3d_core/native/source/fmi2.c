/* Functional Mock-up Interface 2.0: co-simulation and model exchange. */

#define FMI(name) fmi2##name
#define FMI_STATE(before, behind) fmi2##before##FMUstate##behind
#define FMI_READ_STATE fmi2DeSerializeFMUstate
#include "token.h"
#include "fmi.h"

typedef void (*logger2)(void *, const char *, int, const char *, const char *, ...);
typedef struct {
    logger2 logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(void *, int);
    void *environment;
} callbacks2;
typedef struct {
    int again, terminate, nominals, states, has_next;
    double next;
} event_info2;

static void fmi_log(fmu *f, fmi_status status, const char *category, const char *words)
{
    if (f->logger != NULL && (f->logs || status >= fmi_error)) {
        logger2 log;
        memcpy(&log, &f->logger, sizeof log);
        log(f->environment, f->name, status, category, "%s", words);
    }
}

FMI_API const char *fmi2GetTypesPlatform(void) { return "default"; }

FMI_API const char *fmi2GetVersion(void) { return "2.0"; }

FMI_API S fmi2SetDebugLogging(I instance, int on, size_t n, const char *const categories[])
{
    UNUSED(n), UNUSED(categories);
    F->logs = on != 0;
    return fmi_ok;
}

FMI_API I fmi2Instantiate(const char *name, int type, const char *token, const char *location,
                          const callbacks2 *callbacks, int visible, int logs)
{
    UNUSED(location), UNUSED(visible);
    const char *refusal = fmi_refusal(name, token, type == 0);
    if (refusal != NULL && callbacks != NULL && callbacks->logger != NULL)
        callbacks->logger(callbacks->environment, name, fmi_error, "logStatusError", "%s", refusal);
    fmu *f = refusal == NULL ? fmi_create(name) : NULL;
    if (f == NULL)
        return NULL;
    if (callbacks != NULL) {
        memcpy(&f->logger, &callbacks->logger, sizeof callbacks->logger);
        f->environment = callbacks->environment;
    }
    f->logs = logs != 0;
    f->is_exchange = type == 0;
    return f;
}

FMI_API S fmi2SetupExperiment(I instance, int has_tolerance, double tolerance, double start,
                              int has_stop, double stop)
{
    UNUSED(has_tolerance), UNUSED(tolerance);
    return fmi_setup(F, start, has_stop != 0, stop);
}

FMI_API S fmi2EnterInitializationMode(I instance)
{
    UNUSED(instance);
    return fmi_ok;
}

FMI_API S fmi2GetReal(I instance, const R r[], size_t n, double v[]) { return fmi_get(F, r, n, v); }

FMI_API S fmi2SetReal(I instance, const R r[], size_t n, const double v[])
{
    return fmi_set(F, r, n, v);
}

/* There are no variables of other types. */
#define NONE(name, type)                                                                          \
    FMI_API S fmi2Get##name(I instance, const R r[], size_t n, type v[])                          \
    {                                                                                             \
        UNUSED(r), UNUSED(v);                                                                     \
        return fmi_none(F, n);                                                                    \
    }                                                                                             \
    FMI_API S fmi2Set##name(I instance, const R r[], size_t n, const type v[])                    \
    {                                                                                             \
        UNUSED(r), UNUSED(v);                                                                     \
        return fmi_none(F, n);                                                                    \
    }
NONE(Integer, int)
NONE(Boolean, int)
NONE(String, text)

FMI_API S fmi2GetDirectionalDerivative(I instance, const R unknowns[], size_t count,
                                       const R knowns[], size_t given, const double seed[],
                                       double result[])
{
    return fmi_directional(F, unknowns, count, knowns, given, seed, result);
}
ABSENT(fmi2SetRealInputDerivatives, P, size_t, P, P)
ABSENT(fmi2GetRealOutputDerivatives, P, size_t, P, P)
ABSENT(fmi2GetStringStatus, int, P)
ABSENT(fmi2GetIntegerStatus, int, P)

/* ---------------------------------------------------------------------- model exchange */

FMI_API S fmi2NewDiscreteStates(I instance, event_info2 *info)
{
    bool changed = false;
    S status = F->is_initialised ? fmi_event(F, &changed) : fmi_ok;
    info->again = info->nominals = 0;
    info->terminate = F->is_terminated;
    info->states = changed;
    info->next = dap3d_next_event(F->model, F->model->t);
    info->has_next = info->next < INFINITY;
    return status;
}

FMI_API S fmi2CompletedIntegratorStep(I instance, int no_set_state, int *event, int *terminate)
{
    bool due;
    UNUSED(no_set_state);
    S status = fmi_completed(F, &due);
    *event = due;
    *terminate = 0;
    return status;
}

FMI_API S fmi2GetDerivatives(I instance, double rates[], size_t n)
{
    return fmi_derivatives(F, rates, n);
}

/* ---------------------------------------------------------------------- co-simulation */

FMI_API S fmi2DoStep(I instance, double t, double h, int no_set_state)
{
    bool ended;
    UNUSED(no_set_state);
    S status = fmi_step(F, t, t + h, &ended);
    return status == fmi_ok && ended && dap3d_time(F->model) < t + h ? fmi_discard : status;
}

FMI_API S fmi2CancelStep(I instance)
{
    return fmi_failed(F, fmi_error, "steps are done when fmi2DoStep returns");
}

FMI_API S fmi2GetStatus(I instance, int kind, int *status)
{
    UNUSED(instance), UNUSED(kind), UNUSED(status);
    return fmi_discard;
}

FMI_API S fmi2GetRealStatus(I instance, int kind, double *value)
{
    if (kind != 2)
        return fmi_discard;
    *value = dap3d_time(F->model);
    return fmi_ok;
}

FMI_API S fmi2GetBooleanStatus(I instance, int kind, int *value)
{
    if (kind != 3)
        return fmi_discard;
    *value = F->is_terminated;
    return fmi_ok;
}
