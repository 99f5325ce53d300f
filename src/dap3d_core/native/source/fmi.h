/* What FMI 2.0 and 3.0 have in common: an instance, its log, events, and functions whose names the
   files of the versions give. Declarations follow the Functional Mock-up Interface standard; of its
   types those are declared that are used. */

#ifndef FMI_H
#define FMI_H

#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define DAP3D_INSIDE
#include "runtime.c"

#if defined(_WIN32)
#define FMI_API __declspec(dllexport)
#else
#define FMI_API __attribute__((visibility("default")))
#endif

typedef enum { fmi_ok, fmi_warning, fmi_discard, fmi_error, fmi_fatal } fmi_status;
typedef void *I;
typedef uint32_t R;
typedef fmi_status S;
#define F ((fmu *)instance)
#define UNUSED(x) (void)(x)

/* An instance of an FMU. In model exchange t and y are those of the environment. */
typedef struct {
    dap3d_model *model;
    void *environment;
    void *logger;            /* differs from version to version */
    char *name;
    bool logs, is_exchange, is_initialised, is_terminated;
    bool early_return;       /* of FMI 3: steps may end early */
    bool has_events;         /* of FMI 3: event mode is used in co-simulation */
    void *intermediate;      /* of FMI 3: callback */
    double moved;
} fmu;

/* A state that was kept: of the instance, then of the model. */
typedef struct {
    uint64_t identity;
    bool is_initialised, is_terminated;
} fmu_state;

/* Largest change by a projection, for which an integrator of the environment need not stop. */
#define DRIFT 1e-9

static void fmi_log(fmu *f, fmi_status status, const char *category, const char *words);

static fmi_status fmi_failed(fmu *f, fmi_status status, const char *words)
{
    fmi_log(f, status, "logStatusError", words);
    return status;
}

/* Why there is no instance; NULL where there may be one. */
static const char *fmi_refusal(const char *name, const char *token, bool is_exchange)
{
    if (name == NULL || token == NULL || strcmp(token, FMI_TOKEN) != 0)
        return "the instantiation token (GUID) is another";
    if (is_exchange && COMPLETES)
        return "steps follow contacts here: there is co-simulation alone";
    return NULL;
}

static fmu *fmi_create(const char *name)
{
    fmu *f = calloc(1, sizeof *f);
    if (f == NULL)
        return NULL;
    f->name = malloc(strlen(name) + 1);
    f->model = dap3d_create(0.0);
    if (f->name == NULL || f->model == NULL) {
        free(f->name);
        dap3d_free(f->model);
        free(f);
        return NULL;
    }
    strcpy(f->name, name);
    return f;
}

/* The run ends at a time from here on; inputs and parameters stay as they are. */
static fmi_status fmi_setup(fmu *f, double start, bool has_stop, double stop)
{
    if (start != 0.0)
        return fmi_failed(f, fmi_error, "the start time of the model is 0");
    f->model->t_end = f->model->span = has_stop && stop > 0.0 && stop <= LARGEST ? stop : HORIZON;
    for (int k = 0; k < INTEGRATIONS; k++)
        numbers(f->model, integrations[k].times)[2] = f->model->t_end;
    set_stops(f->model);
    if (!f->model->is_under_way) /* what was read or set before began a run of another end */
        begin_with(f->model, 0, 0.0);
    return fmi_ok;
}

static fmi_status fmi_get(fmu *f, const uint32_t *references, size_t count, double *values)
{
    for (size_t k = 0; k < count; k++) {
        if (references[k] >= VARIABLES)
            return fmi_failed(f, fmi_error, "there is no variable of such a reference");
        values[k] = dap3d_get(f->model, (int)references[k]);
        if (isnan(values[k]))
            return fmi_failed(f, fmi_discard, "a variable is not a number at this time and state");
    }
    return fmi_ok;
}

static fmi_status fmi_set(fmu *f, const uint32_t *references, size_t count, const double *values)
{
    for (size_t k = 0; k < count; k++) {
        if (references[k] < VARIABLES && variables[references[k]].kind == DAP3D_STATE) {
            double y[STATES];
            dap3d_states(f->model, y);
            y[variables[references[k]].first] = values[k];
            if (dap3d_set_states(f->model, f->model->t, y) != DAP3D_OK)
                return fmi_failed(f, fmi_error, dap3d_message(f->model));
        } else if (dap3d_set(f->model, (int)references[k], values[k]) != DAP3D_OK) {
            return fmi_failed(f, fmi_error, dap3d_message(f->model));
        }
    }
    return fmi_ok;
}

/* One step of co-simulation; *ended where the model has ended the run before. */
static fmi_status fmi_step(fmu *f, double t, double end, bool *ended)
{
    double now = dap3d_time(f->model);
    *ended = false;
    if (f->is_exchange || !f->is_initialised || f->is_terminated)
        return fmi_failed(f, fmi_error, "steps of co-simulation begin when it is initialised and end "
                                        "when it is terminated");
    if (fabs(t - now) > 1e-9 * fmax(fabs(t), 1e-3))
        return fmi_failed(f, fmi_error, "the communication point is not where the last step ended");
    if (!(end > t))
        return fmi_failed(f, fmi_error, "the communication step size is not positive");
    int result = dap3d_step_to(f->model, end);
    if (result == DAP3D_OK)
        return fmi_ok;
    if (result == DAP3D_ENDED) {
        f->is_terminated = *ended = true;
        fmi_log(f, fmi_warning, "logStatusWarning", dap3d_message(f->model));
        return fmi_ok;
    }
    return fmi_failed(f, fmi_error, dap3d_message(f->model));
}

/* An event of model exchange. Whether the state has changed. */
static fmi_status fmi_event(fmu *f, bool *changed)
{
    int moved = 0;
    if (dap3d_event(f->model, &moved) != DAP3D_OK)
        return fmi_failed(f, fmi_error, dap3d_message(f->model));
    *changed = moved != 0;
    return fmi_ok;
}

/* A step of the environment is done; whether constraints have drifted so far that an event is due.
   Turns of angles are counted. */
static fmi_status fmi_completed(fmu *f, bool *event)
{
    double y[STATES];
    dap3d_states(f->model, y);
    *event = dap3d_project(f->model, f->model->t, y, &f->moved) == DAP3D_OK && f->moved > DRIFT;
    if (dap3d_set_states(f->model, f->model->t, y_of(f->model)) != DAP3D_OK)
        return fmi_failed(f, fmi_error, dap3d_message(f->model));
    return fmi_ok;
}

static fmi_status fmi_derivatives(fmu *f, double *rates, size_t count)
{
    double y[STATES];
    if (count != STATES)
        return fmi_failed(f, fmi_error, "the number of states is another");
    dap3d_states(f->model, y);
    if (dap3d_derivatives(f->model, f->model->t, y, rates) != DAP3D_OK)
        return fmi_failed(f, fmi_discard, dap3d_message(f->model));
    return fmi_ok;
}

/* Derivatives along a direction; references are those of variables. */
static fmi_status fmi_directional(fmu *f, const uint32_t *unknowns, size_t count,
                                  const uint32_t *knowns, size_t given, const double *seed,
                                  double *result)
{
    if (dap3d_directional(f->model, (const int *)unknowns, (int)count, (const int *)knowns,
                          (int)given, seed, result) != DAP3D_OK)
        return fmi_failed(f, fmi_error, dap3d_message(f->model));
    return fmi_ok;
}

/* ---------------------------------------------------- functions that both versions have */

FMI_API void FMI(FreeInstance)(I instance)
{
    if (F == NULL)
        return;
    dap3d_free(F->model);
    free(F->name);
    free(F);
}

FMI_API S FMI(ExitInitializationMode)(I instance)
{
    start(F->model);
    if (F->model->is_under_way && !F->is_initialised) { /* states have been set: it begins there */
#if CONTACTS
        double *states = y_of(F->model) + STATES - 1 - ELEMENT_STATES;
        for (int c = 0; c < CONTACTS; c++)
            states[F->model->w[CONTACT_STATE + c]] = 0.0; /* open */
#endif
        jump_at_start(F->model);
        F->model->has_row = 0;
    }
    if (integer_of(F->model)[I_status] > FINISHED)
        return stopped(F->model), fmi_failed(F, fmi_error, dap3d_message(F->model));
    F->model->is_under_way = 1;
    return F->is_initialised = true, fmi_ok;
}

FMI_API S FMI(Terminate)(I instance) { return F->is_terminated = true, fmi_ok; }

FMI_API S FMI(Reset)(I instance)
{
    begin(F->model, HORIZON);
    F->is_initialised = F->is_terminated = false;
    return fmi_ok;
}

FMI_API S FMI(EnterEventMode)(I instance) { return UNUSED(instance), fmi_ok; }

FMI_API S FMI(EnterContinuousTimeMode)(I instance) { return UNUSED(instance), fmi_ok; }

/* Time of the environment: no integration follows. */
FMI_API S FMI(SetTime)(I instance, double t)
{
    if (!(t >= 0.0 && t <= LARGEST))
        return fmi_failed(F, fmi_error, "the time is not one of the run");
    F->model->t = real_of(F->model)[R_t] = t;
    F->model->has_row = F->model->is_ahead = 0;
    return fmi_ok;
}

FMI_API S FMI(SetContinuousStates)(I instance, const double y[], size_t n)
{
    if (n != STATES)
        return fmi_failed(F, fmi_error, "the number of states is another");
    memcpy(y_of(F->model), y, 8 * STATES);
    F->model->has_row = F->model->is_ahead = 0;
    return fmi_ok;
}

FMI_API S FMI(GetContinuousStates)(I instance, double y[], size_t n)
{
    UNUSED(n);
    dap3d_states(F->model, y);
    return fmi_ok;
}

FMI_API S FMI(GetNominalsOfContinuousStates)(I instance, double nominals[], size_t n)
{
    UNUSED(instance);
    for (size_t k = 0; k < n; k++)
        nominals[k] = 1.0;
    return fmi_ok;
}

FMI_API S FMI(GetEventIndicators)(I instance, double values[], size_t n)
{
    double y[STATES];
    if (n != SWITCHES)
        return fmi_failed(F, fmi_error, "the number of event indicators is another");
    dap3d_states(F->model, y);
    dap3d_indicators(F->model, F->model->t, y, values);
    return fmi_ok;
}

FMI_API S FMI_STATE(Serialized, Size)(I instance, void *state, size_t *size)
{
    UNUSED(instance), UNUSED(state);
    *size = sizeof(fmu_state) + dap3d_state_size();
    return fmi_ok;
}

FMI_API S FMI_STATE(Get, )(I instance, void **state)
{
    fmu_state head = {IDENTITY, F->is_initialised, F->is_terminated};
    if (*state == NULL)
        *state = malloc(sizeof head + dap3d_state_size());
    if (*state == NULL)
        return fmi_error;
    memcpy(*state, &head, sizeof head);
    dap3d_save(F->model, (char *)*state + sizeof head);
    return fmi_ok;
}

FMI_API S FMI_STATE(Set, )(I instance, void *state)
{
    fmu_state head;
    memcpy(&head, state, sizeof head);
    if (head.identity != IDENTITY
        || dap3d_load(F->model, (char *)state + sizeof head) != DAP3D_OK)
        return fmi_failed(F, fmi_error, "the state is not one of this FMU");
    F->is_initialised = head.is_initialised;
    F->is_terminated = head.is_terminated;
    return fmi_ok;
}

FMI_API S FMI_STATE(Free, )(I instance, void **state)
{
    UNUSED(instance);
    if (state != NULL) {
        free(*state);
        *state = NULL;
    }
    return fmi_ok;
}

FMI_API S FMI_STATE(Serialize, )(I instance, void *state, char bytes[], size_t size)
{
    if (size < sizeof(fmu_state) + dap3d_state_size())
        return fmi_failed(F, fmi_error, "there is too little room for the state");
    memcpy(bytes, state, sizeof(fmu_state) + dap3d_state_size());
    return fmi_ok;
}

FMI_API S FMI_READ_STATE(I instance, const char bytes[], size_t size, void **state)
{
    if (size != sizeof(fmu_state) + dap3d_state_size())
        return fmi_failed(F, fmi_error, "the state is not one of this FMU");
    if (*state == NULL)
        *state = malloc(size);
    if (*state == NULL)
        return fmi_error;
    memcpy(*state, bytes, size);
    return fmi_ok;
}

/* Functions of what there is none of; their arguments are not read. */
#define ABSENT(name, ...)                                                                         \
    FMI_API S name(I instance, __VA_ARGS__) { return fmi_failed(F, fmi_error, #name ": no such"); }
#define P const void *
typedef const char *text;

static S fmi_none(fmu *f, size_t count)
{
    return count == 0 ? fmi_ok : fmi_failed(f, fmi_error, "there is no variable of such a type");
}

#endif
