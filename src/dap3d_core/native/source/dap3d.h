/* A model of dap3d as a C library.

   The library needs the C library alone: no Python, no files, no threads of its own. All numbers are
   in SI units. A program that uses it is in example.c; the variables of this model, with their
   references, units and meanings, are in variables.h.

   A run:

       dap3d_model *m = dap3d_create(10.0);            a run from t = 0 to t = 10 s
       if (m == NULL) ...                              there is no memory
       dap3d_set(m, dap3d_find("motor"), 3.0);         an input or a parameter by its name
       for (int k = 1; k <= 1000; k++) {
           if (dap3d_step_to(m, 0.01 * k) != DAP3D_OK) {
               fprintf(stderr, "%s\n", dap3d_message(m));
               break;
           }
           printf("%g\n", dap3d_get(m, dap3d_find("load.r.z")));
       }
       dap3d_free(m);

   Time. The communication points are the times given to dap3d_step_to. Models without inputs
   integrate with steps of their own and interpolate between their ends: the numbers are, bit for
   bit, those of dap.simulate with results at the same times. Models with inputs end a step at each
   communication point, and hold the inputs from one to the next: the numbers are those of dap.start
   and step.

   Instances. Every function takes the instance that it works on, and touches no other memory that
   changes: instances may be used by different threads at once, one instance by one thread at a
   time. Memory is allocated in dap3d_create alone. */

#ifndef DAP3D_H
#define DAP3D_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

#if defined(DAP3D_STATIC) || defined(DAP3D_INSIDE)
#define DAP3D_API
#elif defined(_WIN32) && defined(DAP3D_BUILD)
#define DAP3D_API __declspec(dllexport)
#elif defined(_WIN32)
#define DAP3D_API __declspec(dllimport)
#else
#define DAP3D_API __attribute__((visibility("default")))
#endif

/* One run of the model: its state, inputs and parameters. */
typedef struct dap3d_model dap3d_model;

/* What functions return: negative numbers are errors. */
enum {
    DAP3D_OK = 0,
    DAP3D_ENDED = 1,       /* the run is over: its last time is reached, or the model has ended it */
    DAP3D_ERROR = -1,      /* the run cannot go on; dap3d_message says why */
    DAP3D_INVALID = -2     /* an argument makes no sense; nothing was done */
};

/* Kinds of variables. */
enum { DAP3D_TIME, DAP3D_INPUT, DAP3D_PARAMETER, DAP3D_OUTPUT, DAP3D_STATE, DAP3D_DERIVATIVE,
       DAP3D_INDICATOR, DAP3D_FIXED /* a parameter that is set before the run begins alone */ };

/* ---------------------------------------------------------------------- instances */

/* Begin a run from t = 0 to t_end in seconds; 0 for one whose end is not known, which has a little
   less precision of time. NULL if there is no memory or t_end is no such number. */
DAP3D_API dap3d_model *dap3d_create(double t_end);

/* Give the memory of a run back; NULL is allowed. */
DAP3D_API void dap3d_free(dap3d_model *model);

/* Begin again at t = 0, with the inputs and parameters of the scene. */
DAP3D_API void dap3d_reset(dap3d_model *model);

/* Why the last call that returned an error did so; "" for no reason. It holds until the next call. */
DAP3D_API const char *dap3d_message(const dap3d_model *model);

/* ---------------------------------------------------------------------- variables */

/* The number of variables; they have the references 0, 1, ... */
DAP3D_API int dap3d_count(void);

/* Name, unit ("1" for none) and kind of a variable; NULL, or -1, for a reference that is none. */
DAP3D_API const char *dap3d_name(int variable);
DAP3D_API const char *dap3d_unit(int variable);
DAP3D_API int dap3d_kind(int variable);

/* The reference of a variable by its name, -1 if there is none. Look it up once. */
DAP3D_API int dap3d_find(const char *name);

/* Set an input or a parameter. It takes effect from the present time on. DAP3D_INVALID if the
   variable is neither, the value is not finite or not within the limits that variables.h names, or a
   fixed parameter is set in the course of a run: before it the start is found anew, and outputs show
   what was set. Inertias are checked where the run begins, and parameters of which one has to be under
   another where it goes on: functions that need them return DAP3D_INVALID until they are. */
DAP3D_API int dap3d_set(dap3d_model *model, int variable, double value);

/* The value of a variable at the present time; not a number for a reference that is none. */
DAP3D_API double dap3d_get(dap3d_model *model, int variable);

/* The values of several variables. DAP3D_INVALID if a reference is none. */
DAP3D_API int dap3d_get_all(dap3d_model *model, const int *variables, int count, double *values);

/* ---------------------------------------------------------------------- time */

/* The present time, in seconds. */
DAP3D_API double dap3d_time(const dap3d_model *model);

/* Go on to a later time. DAP3D_ENDED if the model ends the run before, at dap3d_time(model), which
   is also where a run that fails has stopped. */
DAP3D_API int dap3d_step_to(dap3d_model *model, double t);

/* ---------------------------------------------------------------------- states of a run */

/* Bytes that dap3d_save writes. */
DAP3D_API size_t dap3d_state_size(void);

/* Write all of a run to memory, or a file of one's own; the run continues from there with the same
   bits, also in another process or instance of the same library. */
DAP3D_API int dap3d_save(const dap3d_model *model, void *state);

/* Continue from what dap3d_save wrote. DAP3D_INVALID if it is not of this library. */
DAP3D_API int dap3d_load(dap3d_model *model, const void *state);

/* ---------------------------------------------------------------------- equations

   For programs with an integrator of their own: y' = f(t, y). The states are those of the variables
   of kind DAP3D_STATE, in their order: positions (m) and Euler parameters of all bodies, velocities
   (m/s) and angular velocities in axes of the bodies (rad/s), states of elements, the work done on
   the system (J). These functions do not move the run, but for dap3d_set_states. */

/* The number of states. */
DAP3D_API int dap3d_state_count(void);

/* The states at the present time. */
DAP3D_API int dap3d_states(const dap3d_model *model, double *y);

/* Make t and y the present time and state; steps continue from there. Modes of contacts are states
   as well: of a body that is lifted off what it touched, give the mode 0. */
DAP3D_API int dap3d_set_states(dap3d_model *model, double t, const double *y);

/* Their derivatives at t and y. DAP3D_ERROR if they are not finite; DAP3D_INVALID where contacts are
   stepped: velocities jump there. */
DAP3D_API int dap3d_derivatives(dap3d_model *model, double t, const double *y, double *rates);

/* Derivatives of unknowns (outputs, derivatives) at the present time and state along a direction: by
   knowns (states, inputs, tunable parameters, time), each times its seed. They are exact to rounding,
   as is the code that is differentiated; where a function bends, those of the side that is computed.
   DAP3D_INVALID for variables of other kinds, outputs that are means of a step of contacts
   (accelerations, reactions), and models without derivatives. */
DAP3D_API int dap3d_directional(dap3d_model *model, const int *unknowns, int count,
                                const int *knowns, int known_count, const double *seed,
                                double *result);

/* Bring y at t onto the constraints, from near them. On return *moved (if not NULL) is the largest
   change of a state. */
DAP3D_API int dap3d_project(dap3d_model *model, double t, double *y, double *moved);

/* The number of functions whose changes of sign are events, such as the closing of a contact, and
   their values at t and y. */
DAP3D_API int dap3d_indicator_count(void);
DAP3D_API int dap3d_indicators(dap3d_model *model, double t, const double *y, double *values);

/* Handle an event at the present time and state, as at the start of a run, and where an indicator
   has changed its sign: velocities jump, if the model has such elements, and the state is brought
   onto the constraints. *changed is 1 where the states are others then. */
DAP3D_API int dap3d_event(dap3d_model *model, int *changed);

/* The first time after t at which a function of time takes another form; infinite if none does. */
DAP3D_API double dap3d_next_event(const dap3d_model *model, double t);

#ifdef __cplusplus
}
#endif

#endif
