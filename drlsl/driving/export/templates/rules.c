@HEAD@

#include "rules.h"

#include <float.h>
#include <math.h>
#include <string.h>

#if defined(__FAST_MATH__)
#error "compile without -ffast-math: these rules test for numbers that are none"
#endif
#if FLT_EVAL_METHOD != 0
#error "doubles are rounded later than written: compile with -msse2 -mfpmath=sse"
#endif
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#endif

const char *const drlsl_action_names[DRLSL_ACTIONS] = {@ACTION_NAMES@};
const char *const drlsl_observation_names[DRLSL_OBSERVATION] = {@OBSERVATION_NAMES@};
const char *const drlsl_reason_names[] = {@REASON_NAMES@};
const char *const drlsl_reason_details[] = {@REASON_DETAILS@};
const char *const drlsl_atom_names[] = {@ATOM_NAMES@};

const drlsl_road DRLSL_ROAD = {
    .time_step = @TIME_STEP@,
    .radar_range = @RADAR_RANGE@,
@LIMITS@
};

static const double observation_bounds[DRLSL_OBSERVATION][2] = {@BOUNDS@};

/* Generated code */

@PROGRAM@
/* The scene */

int32_t drlsl_lane_at(const drlsl_road *road, double y)
{
    for (int32_t place = 0; place < road->lane_count && place < DRLSL_MAX_LANES; place += 1) {
        const drlsl_lane *const lane = &road->lanes[place];
        if (fabs(y - lane->centre) <= lane->width / 2.0) {
            return lane->id;
        }
    }
    return 0;
}

static bool has_lane(const drlsl_road *road, int32_t id)
{
    bool found = false;
    for (int32_t place = 0; place < road->lane_count; place += 1) {
        found = found || road->lanes[place].id == id;
    }
    return found;
}

static bool is_possible(const drlsl_scene *scene)
{
    const drlsl_road *const road = &scene->road;
    if (road->lane_count < 1 || road->lane_count > DRLSL_MAX_LANES || scene->vehicle_count < 0
        || scene->vehicle_count > DRLSL_MAX_VEHICLES) {
        return false;
    }
    bool possible = road->time_step > 0.0 && road->radar_range > 0.0 && has_lane(road, scene->target_lane)
        && has_lane(road, scene->ego.lane) && scene->ego.length > 0.0 && scene->ego.width > 0.0;
    for (int32_t place = 0; place < road->lane_count; place += 1) {
        const drlsl_lane *const lane = &road->lanes[place];
        possible = possible && lane->id >= 1 && lane->width > 0.0 && lane->speed_limit > 0.0
            && (lane->direction == DRLSL_LEFT_TO_RIGHT || lane->direction == DRLSL_RIGHT_TO_LEFT)
            && (place == 0 || road->lanes[place - 1].centre <= lane->centre);
    }
    for (int32_t place = 0; place < scene->vehicle_count; place += 1) {
        const drlsl_vehicle *const vehicle = &scene->vehicles[place];
        possible = possible && vehicle->id >= 0 && vehicle->length > 0.0 && vehicle->width > 0.0
            && (vehicle->lane == 0 || has_lane(road, vehicle->lane));
    }
    return possible;
}

static bool is_seen(const drlsl_scene *scene, const drlsl_vehicle *vehicle)
{
    const double dx = vehicle->x - scene->ego.x;
    const double dy = vehicle->y - scene->ego.y;
    return !(sqrt(dx * dx + dy * dy) > scene->road.radar_range);
}

@FILLS@
/* The decision */

static drlsl_status fail_safe(
    const drlsl_scene *scene, drlsl_decision *decision, drlsl_status status, drlsl_problem problem)
{
    const double speed = fabs(scene->ego.vx) - scene->road.braking_limit * scene->road.time_step;
    decision->status = status;
    decision->problem = problem;
    for (int32_t action = 0; action < (int32_t)DRLSL_ACTIONS; action += 1) {
        decision->offered[action] = action == 0;
    }
    decision->target_speed = speed > 0.0 ? speed : 0.0;
    decision->comfortable_acceleration = INFINITY;
    for (int32_t place = 0; place < DRLSL_OBSERVATION; place += 1) {
        const double low = observation_bounds[place][0];
        const double high = observation_bounds[place][1];
        decision->observation[place] = low > 0.0 ? low : high < 0.0 ? high : 0.0;
    }
    decision->front_is_free = false;
    decision->lane_to_keep = scene->target_lane;
    return status;
}

static bool write_decision(const drlsl_scene *scene, const decision_answers *answers, drlsl_decision *decision)
{
    drlsl_problem problem = DRLSL_NO_PROBLEM;
    for (int32_t action = 0; action < (int32_t)DRLSL_ACTIONS; action += 1) {
        decision->offered[action] = false;
    }
@WRITE@
    bool offers = false;
    for (int32_t action = 0; action < (int32_t)DRLSL_ACTIONS; action += 1) {
        offers = offers || decision->offered[action];
    }
    if (!offers) {
        problem = DRLSL_NO_ACTION;
    } else if (!(decision->target_speed >= 0.0 && decision->target_speed < INFINITY)) {
        problem = DRLSL_NO_SPEED;
    } else if (!(decision->comfortable_acceleration > -INFINITY)) {
        problem = DRLSL_NO_ACCELERATION;
    }
    for (int32_t place = 0; place < DRLSL_OBSERVATION; place += 1) {
        const double value = decision->observation[place];
        if (!(observation_bounds[place][0] <= value && value <= observation_bounds[place][1])) {
            problem = DRLSL_NO_OBSERVATION;
        }
    }
    decision->problem = problem;
    return problem == DRLSL_NO_PROBLEM;
}

drlsl_status drlsl_decide(const drlsl_scene *scene, drlsl_decision *decision)
{
    decision_facts facts;
    decision_answers answers;
    if (!is_possible(scene)) {
        return fail_safe(scene, decision, DRLSL_FAILED, DRLSL_SCENE_IMPOSSIBLE);
    }
    memset(&answers, 0, sizeof answers);
    decision_fill(scene, &facts);
    if (!decision_answer(&facts, &answers)) {
        return fail_safe(scene, decision, DRLSL_UNDECIDED, DRLSL_OUT_OF_BOUNDS);
    }
    if (!write_decision(scene, &answers, decision)) {
        return fail_safe(scene, decision, DRLSL_FAILED, decision->problem);
    }
    decision->status = DRLSL_DECIDED;
    return DRLSL_DECIDED;
}

drlsl_status drlsl_find_reasons(const drlsl_scene *scene, drlsl_reasons *reasons)
{
    reasons->status = DRLSL_FAILED;
    reasons->count = 0;
    reasons->left_out = 0;
    if (!is_possible(scene)) {
        return DRLSL_FAILED;
    }
@FIND@
    reasons->status = DRLSL_DECIDED;
    return DRLSL_DECIDED;
}
