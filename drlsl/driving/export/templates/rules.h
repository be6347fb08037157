@HEAD@

/*
 * drlsl_decide() says which actions are safe in a scene, and how fast to go. It allocates nothing, calls itself nowhere, keeps
 * nothing between calls, and every loop ends after as many steps as there is room for; threads may call it at once.
 *
 * Lengths are in m, speeds in m/s, accelerations in m/s2. x runs along the road and y across it, downward, so a driver heading
 * right (+x) has smaller y on the left. Compile with -std=c99 or -ffp-contract=off, without -ffast-math: the numbers are then
 * those of drlsl, bit for bit.
 */

#ifndef DRLSL_RULES_H
#define DRLSL_RULES_H

#include <stdbool.h>
#include <stdint.h>

#define DRLSL_MAX_LANES @LANES@
#define DRLSL_MAX_VEHICLES @VEHICLES@
#define DRLSL_MAX_REASONS @REASONS@
#define DRLSL_MAX_DETAILS @DETAILS@
#define DRLSL_OBSERVATION @OBSERVATION@

typedef enum { @ACTIONS@, DRLSL_ACTIONS } drlsl_action;
typedef enum { DRLSL_LEFT_TO_RIGHT, DRLSL_RIGHT_TO_LEFT } drlsl_direction;

typedef struct {
    int32_t id; /* 1 or more, each once */
    drlsl_direction direction;
    double centre, width, speed_limit; /* centre: the y of the centre line */
    bool ends;                         /* whether it ends at the x `end`; else that is not read */
    double end;
} drlsl_lane;

typedef struct {
    int32_t lane_count;
    drlsl_lane lanes[DRLSL_MAX_LANES]; /* of both directions, in the order of their centre lines */
    double time_step;                  /* until the rules are asked again [s] */
    double radar_range;                /* vehicles beyond it are left out */
    double acceleration_limit, braking_limit, centre_tolerance; /* of the ego; DRLSL_ROAD has the usual ones */
} drlsl_road;

typedef struct {
    int32_t id;   /* 0 or more, each once; that of the ego is not read */
    int32_t lane; /* the lane that holds the centre, 0 for none: drlsl_lane_at() */
    double x, y, vx, vy, length, width; /* the centre of the box, the velocity in road coordinates, the size */
} drlsl_vehicle;

typedef struct {
    drlsl_road road;
    drlsl_vehicle ego;
    int32_t target_lane; /* the lane that the ego steers for */
    int32_t vehicle_count;
    drlsl_vehicle vehicles[DRLSL_MAX_VEHICLES]; /* the others */
} drlsl_scene;

typedef enum {
    DRLSL_DECIDED,
    DRLSL_UNDECIDED, /* only the interpreter can tell */
    DRLSL_FAILED     /* the scene or the answer of the rules is not usable */
} drlsl_status;

typedef enum {
    DRLSL_NO_PROBLEM,
    DRLSL_SCENE_IMPOSSIBLE,  /* failed: a count, a lane, an id or a direction is not possible */
    DRLSL_OUT_OF_BOUNDS,     /* undecided: a number is not finite or too large, or an operation may have no value */
    DRLSL_NO_ACTION,         /* failed: the rules offer no action */
    DRLSL_NO_SPEED,          /* failed: longitudinal_velocity/1 gave no speed */
    DRLSL_NO_OBSERVATION,    /* failed: state/1 gave no numbers within their bounds */
    DRLSL_NO_LANE,           /* failed: lane_to_keep/1 gave no lane */
    DRLSL_NO_ACCELERATION    /* failed: comfortable_acceleration/1 gave no acceleration */
} drlsl_problem;

/*
 * Unless `status` is DRLSL_DECIDED this is the fail-safe: keep the lane and brake as hard as the ego can. A comfortable_acceleration
 * of INFINITY means that the rules do not say. drlsl_observation_names[] names the numbers of `observation`.
 */
typedef struct {
    drlsl_status status;
    drlsl_problem problem;
    bool offered[DRLSL_ACTIONS];
    double target_speed;
    double comfortable_acceleration;
    double observation[DRLSL_OBSERVATION];
    bool front_is_free;
    int32_t lane_to_keep;
} drlsl_decision;

/*
 * What speaks against an action. drlsl_reason_names[reason] is its name, and drlsl_reason_details[reason] has a letter for each of its
 * details: n a number, a an atom, which is the id of a vehicle, or, below 0, drlsl_atom_names[-1 - atom].
 */
typedef struct {
    drlsl_action action;
    int32_t reason;
    double details[DRLSL_MAX_DETAILS];
} drlsl_reason;

typedef struct {
    drlsl_status status;
    int32_t count;
    int32_t left_out; /* there was no room for as many more */
    drlsl_reason reasons[DRLSL_MAX_REASONS];
} drlsl_reasons;

extern const char *const drlsl_action_names[DRLSL_ACTIONS];
extern const char *const drlsl_observation_names[DRLSL_OBSERVATION];
extern const char *const drlsl_reason_names[];
extern const char *const drlsl_reason_details[];
extern const char *const drlsl_atom_names[];

/* The road without lanes, and the ego's usual limits. */
extern const drlsl_road DRLSL_ROAD;

/* Return the id of the lane whose strip holds y, 0 if none does. */
int32_t drlsl_lane_at(const drlsl_road *road, double y);

/* Write the decision about a scene, or the fail-safe; return its status. */
drlsl_status drlsl_decide(const drlsl_scene *scene, drlsl_decision *decision);

/* Write what speaks against actions in a scene, in the order of the rules, each as often as they derive it; return the status. */
drlsl_status drlsl_find_reasons(const drlsl_scene *scene, drlsl_reasons *reasons);

#endif
