@HEAD@

/* Check the decisions of rules.c against @COUNT@ stored ones: cc -std=c99 -O2 rules.c check.c -lm -o check && ./check */

#include <float.h>
#include <math.h>
#include <stdio.h>

#include "rules.h"

#define COUNT @COUNT@
#define ULPS @ULPS@ /* how far exp, sin and the like may be off; all else is exact */

typedef struct {
    int32_t first_lane, lane_count;
    double time_step;
    int32_t target_lane, first_vehicle, vehicle_count; /* the first vehicle is the ego */
    bool usable;                                       /* else the rules fail */
    bool offered[DRLSL_ACTIONS];
    double target_speed, comfortable_acceleration;
    bool front_is_free;
    int32_t lane_to_keep;
    int32_t reason_count; /* different ones */
    double reason_sum;    /* of their numbers */
    double observation[DRLSL_OBSERVATION];
} stored_decision;

static const drlsl_lane lanes[] = {
@LANES@
};

static const drlsl_vehicle vehicles[] = {
@VEHICLES@
};

static const stored_decision stored[] = {
@STORED@
};

static bool is_near(double one, double other)
{
    const double most = ULPS * DBL_EPSILON * fmax(fabs(one), fabs(other));
    return one == other || fabs(one - other) <= most;
}

static void read_scene(const stored_decision *from, drlsl_scene *scene)
{
    scene->road = DRLSL_ROAD;
    scene->road.time_step = from->time_step;
    scene->road.lane_count = from->lane_count;
    for (int32_t place = 0; place < from->lane_count; place += 1) {
        scene->road.lanes[place] = lanes[from->first_lane + place];
    }
    scene->target_lane = from->target_lane;
    scene->ego = vehicles[from->first_vehicle];
    scene->vehicle_count = from->vehicle_count - 1;
    for (int32_t place = 0; place < scene->vehicle_count; place += 1) {
        scene->vehicles[place] = vehicles[from->first_vehicle + 1 + place];
    }
}

static bool is_same(const stored_decision *from, const drlsl_decision *decision)
{
    if (decision->status != DRLSL_DECIDED || !from->usable) {
        return decision->status == DRLSL_FAILED && !from->usable;
    }
    bool same = is_near(decision->target_speed, from->target_speed)
        && is_near(decision->comfortable_acceleration, from->comfortable_acceleration)
        && decision->front_is_free == from->front_is_free && decision->lane_to_keep == from->lane_to_keep;
    for (int32_t action = 0; action < (int32_t)DRLSL_ACTIONS; action += 1) {
        same = same && decision->offered[action] == from->offered[action];
    }
    for (int32_t place = 0; place < DRLSL_OBSERVATION; place += 1) {
        same = same && is_near(decision->observation[place], from->observation[place]);
    }
    return same;
}

static bool is_repeated(const drlsl_reasons *reasons, int32_t place)
{
    for (int32_t other = 0; other < place; other += 1) {
        bool same = reasons->reasons[other].action == reasons->reasons[place].action
            && reasons->reasons[other].reason == reasons->reasons[place].reason;
        for (int32_t n = 0; n < DRLSL_MAX_DETAILS; n += 1) {
            same = same && reasons->reasons[other].details[n] == reasons->reasons[place].details[n];
        }
        if (same) {
            return true;
        }
    }
    return false;
}

static bool has_same_reasons(const stored_decision *from, const drlsl_decision *decision, const drlsl_reasons *reasons)
{
    int32_t count = 0;
    double sum = 0.0;
    double size = 0.0;
    for (int32_t place = 0; place < reasons->count; place += 1) {
        const drlsl_reason *const one = &reasons->reasons[place];
        if (decision->offered[one->action] || is_repeated(reasons, place)) {
            continue;
        }
        count += 1;
        for (int32_t n = 0; drlsl_reason_details[one->reason][n] != '\0'; n += 1) {
            if (drlsl_reason_details[one->reason][n] == 'n') {
                sum += one->details[n];
                size += fabs(one->details[n]);
            }
        }
    }
    /* added in another order, so only nearly the same */
    return reasons->left_out == 0 && count == from->reason_count && fabs(sum - from->reason_sum) <= 1e-12 * size;
}

int main(void)
{
    static drlsl_scene scene;
    static drlsl_decision decision;
    static drlsl_reasons reasons;
    int32_t right = 0;
    int32_t undecided = 0;
    for (int32_t place = 0; place < COUNT; place += 1) {
        read_scene(&stored[place], &scene);
        const bool is_open = drlsl_decide(&scene, &decision) == DRLSL_UNDECIDED;
        undecided += is_open ? 1 : 0;
        if (is_open) {
            continue;
        }
        bool same = is_same(&stored[place], &decision);
        if (stored[place].usable) {
            same = same && drlsl_find_reasons(&scene, &reasons) != DRLSL_FAILED
                && (reasons.status == DRLSL_UNDECIDED || has_same_reasons(&stored[place], &decision, &reasons));
        }
        right += same ? 1 : 0;
        if (!same && place - right - undecided < 3) {
            printf("scene %d differs\n", (int)place);
        }
    }
    printf("%d of %d decisions are the stored ones, %d undecided\n", (int)right, COUNT, (int)undecided);
    return right + undecided == COUNT && undecided < COUNT ? 0 : 1;
}
