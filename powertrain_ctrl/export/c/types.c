/* ---- what the kernel keeps ------------------------------------------------------------------------------------- */

/* x' = A x + B u - W tau, slips G x, one row a law; outputs on x, torques and inputs. */
typedef struct {
    double A[NX][NX], B[NX][NU], G[ZL][NX], W[ZL][NX], out[ZO][NX + ZL + NU];
} matrices;

/* What must stay positive while a mode lasts, and the index of the mode that follows. */
typedef struct {
    int then;
    double twist, stretch, slip, torque, level, capacity;
} guard;

/* tau = stiffness y + damping s + torque + c (capacity + slope s); leak < 0 is an infinite one. */
typedef struct {
    double number;
    int held, follows, has_origin, first, count; /* guards first ... first + count - 1 */
    double stiffness, damping, torque, capacity, slope, leak, origin;
} mode;

/* Modes first ... first + count - 1; -1 where there is no such mode or stretch. */
typedef struct {
    int first, count, is_clutch, is_rigid, held, idle, unknown, stretch;
} law;

/* Inputs and capacities, and how fast they change; levels are those of friction that depends on slip. */
typedef struct {
    double u[NU], du[NU], capacity[ZL], dcapacity[ZL], level[ZL], speed[ZM];
    int moves;
} segment;

/* tau = x z + u inputs + tau given of laws that hold their slips together. */
typedef struct {
    double x[ZL][NX], u[ZL][NU], tau[ZL][ZL], weight[ZL];
} holding;

/* The driveline while each law stays in one mode. */
typedef struct {
    int used, modes[ZL], held[ZL], n_held, is_held[ZL], held_too[ZL], moving[ZE];
    double level[ZL], damping[ZL], scale[ZE], growth;
    double A[NX][NX], push[NX][NX], flow[NZ][NZ], force_u[NX][NU], force_tau[NX][ZL];
    holding hold;
    double torque_x[ZL][NX], torque_u[ZL][NU], torque_tau[ZL][ZL];
    int n_guards, law[ZG], then[ZG];
    double on_z[ZG][NZ], on_u[ZG][NU], on_tau[ZG][ZL], on_c[ZG], constant[ZG], norm[ZG], turn[ZG];
} pattern;

/* Exact steps of dt / 2^k: z + F z + P1 b + P2 b' . */
typedef struct {
    int used, levels;
    double key[ZL][5], rate, F[LEVELS][NZ][NZ], P1[LEVELS][NZ][NZ], P2[LEVELS][NZ][NZ];
} propagator;

/* Everything that moves: energy coordinates, stretches and twists of laws; modes are indices. */
typedef struct {
    double z[NZ], time, event_time[ZL];
    int modes[ZL], started;
} @NAME@_state;

typedef struct {
    @NAME@_state now;
    const matrices *m;
#if NP > 0
    matrices own;
    double build[NN][NN], root[NN][NN], spread[ZR][ZR], rows[ZR + NN][NN];
#endif
    pattern patterns[PATTERNS];
    propagator propagators[PROPAGATORS];
    int next_pattern, next_propagator, events[ZL];
    double start[NZ], work[4][NZ][NZ], still[NX][NX], since[ZL];
    holding hold;
} @NAME@_plant;

typedef @NAME@_state state;
typedef @NAME@_plant plant;
