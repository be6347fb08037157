@HEAD@
//
// decide(scene) takes an object of the form of scene.json (docs/scene.md) and returns
//
//   { safe_actions, unsafe_actions, target_speed, comfortable_acceleration, observation, front_is_free, lane_to_keep }
//   { undecided: reason, fail_safe }   only the interpreter can tell
//   { failed: reason, fail_safe }      the scene or the answer of the rules is not usable
//
// unsafe_actions has for each action that is not offered what speaks against it, as `drlsl query --json` prints it.
// fail_safe is the decision to keep the lane and brake as hard as the ego can; it is null where the scene cannot be read.
// Lengths are in m, speeds in m/s, accelerations in m/s2.

export const rules = @FILES@;
export const actions = @ACTIONS@;
export const observation_names = @NAMES@;
export const observation_bounds = @BOUNDS@;

const LIMITS = @LIMITS@;
const TIME_STEP = @TIME_STEP@;
const RADAR_RANGE = @RADAR_RANGE@;
const BOX = @BOX@;
const HAS_LANE_TO_KEEP = @HAS_LANE@;
const HAS_COMFORT = @HAS_COMFORT@;
const HAS_REASONS = @HAS_REASONS@;

class Problem extends Error {}

export function decide(scene) {
  let read;
  try {
    read = scene_of(scene);
  } catch (problem) {
    if (!(problem instanceof Problem)) throw problem;
    return { failed: problem.message, fail_safe: null };
  }
  const facts = facts_of(read);
  const answers = answer_decision(facts);
  if (answers === null) return { undecided: UNDECIDED, fail_safe: fail_safe(read) };
  try {
    return decision_of(read, facts, answers);
  } catch (problem) {
    if (!(problem instanceof Problem)) throw problem;
    return { failed: problem.message, fail_safe: fail_safe(read) };
  }
}

const UNDECIDED = "only the interpreter can tell: a number is too large, or an operation of the rules may have no value here";

// The scene

function scene_of(scene) {
  const { road, ego, vehicles = [] } = object_of(scene, "the scene", ["road", "ego", "vehicles"]);
  const fields = object_of(road, "road", ["lanes", "time_step_s", "radar_range_m"]);
  if (!Array.isArray(fields.lanes) || fields.lanes.length === 0) throw new Problem("road.lanes is no list of lanes");
  const lanes = fields.lanes.map((lane, place) => lane_of(lane, `road.lanes[${place}]`));
  lanes.sort((one, other) => one.centre - other.centre);
  refuse_twins(lanes.map((lane) => lane.id), "road.lanes", "lane");
  const own = box_of(ego, "ego", lanes, ["target_lane"]);
  if (own.lane === 0) throw new Problem("ego.y_m is in no lane of the road; give ego.lane or move the ego");
  if (!Array.isArray(vehicles)) throw new Problem("vehicles is no list of vehicles");
  const others = vehicles.map((vehicle, place) => vehicle_of(vehicle, `vehicles[${place}]`, lanes));
  refuse_twins(others.map((vehicle) => vehicle.id), "vehicles", "vehicle");
  return {
    lanes,
    time_step: positive(fields.time_step_s ?? TIME_STEP, "road.time_step_s"),
    radar_range: positive(fields.radar_range_m ?? RADAR_RANGE, "road.radar_range_m"),
    ego: own,
    vehicles: others,
    target_lane: lane_named(ego.target_lane, "ego.target_lane", lanes) ?? own.lane,
  };
}

function object_of(value, place, fields) {
  if (typeof value !== "object" || value === null || Array.isArray(value)) throw new Problem(`${place} is no object`);
  for (const name of Object.keys(value)) {
    if (!fields.includes(name)) throw new Problem(`${place} has a field ${name} that is none of a scene`);
  }
  return value;
}

function number(value, place) {
  if (typeof value !== "number" || !Number.isFinite(value)) throw new Problem(`${place} is ${value}; expected a number`);
  return value;
}

function positive(value, place) {
  if (!(number(value, place) > 0)) throw new Problem(`${place} is ${value}; expected a number greater than 0`);
  return value;
}

function lane_of(lane, place) {
  object_of(lane, place, ["id", "direction", "centre_m", "width_m", "speed_limit_mps", "end_m"]);
  if (!Number.isSafeInteger(lane.id) || lane.id < 1) throw new Problem(`${place}.id is ${lane.id}; expected 1 or more`);
  if (!["left_to_right", "right_to_left"].includes(lane.direction)) {
    throw new Problem(`${place}.direction is ${lane.direction}; expected left_to_right or right_to_left`);
  }
  return {
    id: lane.id,
    direction: lane.direction,
    centre: number(lane.centre_m, `${place}.centre_m`),
    width: positive(lane.width_m, `${place}.width_m`),
    speed_limit: positive(lane.speed_limit_mps, `${place}.speed_limit_mps`),
    end: lane.end_m === undefined || lane.end_m === null ? null : number(lane.end_m, `${place}.end_m`),
  };
}

const BOX_FIELDS = ["x_m", "y_m", "vx_mps", "vy_mps", "length_m", "width_m", "lane"];

function box_of(box, place, lanes, more) {
  object_of(box, place, [...BOX_FIELDS, ...more]);
  const y = number(box.y_m, `${place}.y_m`);
  return {
    lane: lane_named(box.lane, `${place}.lane`, lanes) ?? lane_at(y, lanes),
    x: number(box.x_m, `${place}.x_m`),
    y,
    vx: number(box.vx_mps, `${place}.vx_mps`),
    vy: number(box.vy_mps ?? BOX.vy_mps, `${place}.vy_mps`),
    length: positive(box.length_m ?? BOX.length_m, `${place}.length_m`),
    width: positive(box.width_m ?? BOX.width_m, `${place}.width_m`),
  };
}

function vehicle_of(vehicle, place, lanes) {
  const box = box_of(vehicle, place, lanes, ["id"]);
  if (typeof vehicle.id !== "string" || vehicle.id === "") throw new Problem(`${place}.id is ${vehicle.id}; expected a name`);
  if (vehicle.id === "ego") throw new Problem("vehicles has one called 'ego'; that name is the ego's own");
  return { id: vehicle.id, ...box };
}

function lane_named(lane, place, lanes) {
  if (lane === undefined || lane === null) return undefined;
  if (!lanes.some((one) => one.id === lane)) throw new Problem(`${place} is ${lane}, a lane that the road lacks`);
  return lane;
}

function lane_at(y, lanes) {
  return lanes.find((lane) => Math.abs(y - lane.centre) <= lane.width / 2)?.id ?? 0;
}

function refuse_twins(names, place, what) {
  const twin = names.find((name, n) => names.indexOf(name) < n);
  if (twin !== undefined) throw new Problem(`${place} has ${twin} more than once; each ${what} needs an id of its own`);
}

// The facts

function facts_of({ lanes, time_step, radar_range, ego, vehicles, target_lane }) {
  const seen = vehicles.filter(({ x, y }) => {
    const dx = x - ego.x;
    const dy = y - ego.y;
    return Math.sqrt(dx * dx + dy * dy) <= radar_range;
  });
  const row = (car) => [car.id, car.lane, car.x, car.y, car.vx, car.vy, car.length, car.width];
  const limits = Object.entries(LIMITS).map(([name, value]) => [`${name}/1`, [[value]]]);
  return {
    "vehicle/8": [row({ id: "ego", ...ego }), ...seen.map(row)],
    "road_lane/5": lanes.map((lane) => [lane.id, lane.direction, lane.centre, lane.width, lane.speed_limit]),
    "lane_end/2": lanes.filter((lane) => lane.end !== null).map((lane) => [lane.id, lane.end]),
    "target_lane/1": [[target_lane]],
    "time_step/1": [[time_step]],
    "radar_range/1": [[radar_range]],
    ...Object.fromEntries(limits),
  };
}

// The decision

function decision_of(read, facts, answers) {
  const [offered, speed, observation, front_is_free, ...more] = answers;
  const lane = HAS_LANE_TO_KEEP ? more.shift() : read.target_lane;
  const comfort = HAS_COMFORT ? more.shift() : null;
  const safe_actions = [...new Set(offered)];
  if (safe_actions.length === 0) throw new Problem("the rules offer no action");
  if (!(typeof speed === "number" && speed >= 0 && speed < Infinity)) {
    throw new Problem(`longitudinal_velocity/1 gave ${speed}; expected a speed in m/s, 0 or more`);
  }
  check_observation(observation);
  if (!Number.isSafeInteger(lane)) throw new Problem(`lane_to_keep/1 gave ${lane}; expected a lane`);
  if (HAS_COMFORT && !(typeof comfort === "number" && comfort > -Infinity)) {
    throw new Problem(`comfortable_acceleration/1 gave ${comfort}; expected an acceleration in m/s2`);
  }
  return {
    safe_actions,
    ...reasons_of(facts, safe_actions),
    target_speed: speed,
    comfortable_acceleration: comfort,
    observation,
    front_is_free,
    lane_to_keep: lane,
  };
}

function check_observation(numbers) {
  if (!Array.isArray(numbers) || numbers.length !== observation_names.length) {
    throw new Problem(`state/1 gave ${JSON.stringify(numbers)}; expected a list of ${observation_names.length} numbers`);
  }
  numbers.forEach((value, place) => {
    const [low, high] = observation_bounds[place];
    if (!(typeof value === "number" && low <= value && value <= high)) {
      throw new Problem(`state/1 gave ${value} as ${observation_names[place]}; expected a number from ${low} to ${high}`);
    }
  });
}

function fail_safe({ ego, target_lane, time_step }) {
  return {
    safe_actions: [actions[0]],
    target_speed: Math.max(0, Math.abs(ego.vx) - LIMITS.braking_limit * time_step),
    comfortable_acceleration: null,
    observation: observation_bounds.map(([low, high]) => Math.min(Math.max(0, low), high)),
    front_is_free: false,
    lane_to_keep: target_lane,
  };
}

// The reasons

function reasons_of(facts, safe_actions) {
  const refused = actions.filter((action) => !safe_actions.includes(action));
  const answers = HAS_REASONS ? answer_reasons(facts) : [[]];
  const found = answers === null ? [] : answers[0];
  const unsafe_actions = {};
  for (const action of refused) {
    const reasons = found.filter(([other]) => other === action).map(([, reason]) => objection(reason));
    unsafe_actions[action] = distinct(reasons).sort(by_urgency);
  }
  return answers === null ? { unsafe_actions, reasons_undecided: UNDECIDED } : { unsafe_actions };
}

function objection(reason) {
  if (typeof reason === "string") return { reason };
  const { name, args } = reason;
  const [vehicle, gap, needed] = args;
  const close = name === "too_close" && args.length === 3 && typeof vehicle === "string";
  if (close && typeof gap === "number" && typeof needed === "number") {
    return { reason: name, vehicle, gap, needed, missing: needed - gap };
  }
  return { reason: name, details: args };
}

function by_urgency(one, other) {
  return compare(urgency(one), urgency(other));
}

function urgency({ reason, vehicle = "", gap = -Infinity, needed = 0, details = [] }) {
  const parts = details.flatMap((detail) => (typeof detail === "string" ? [Infinity, detail] : [detail, ""]));
  return [gap, reason, vehicle, needed, ...parts];
}

function compare(one, other) {
  for (let place = 0; place < Math.min(one.length, other.length); place += 1) {
    const [left, right] = [one[place], other[place]].map((part) => (typeof part === "string" ? [...part] : part));
    const order = Array.isArray(left) ? compare(left.map(code), right.map(code)) : left < right ? -1 : left > right ? 1 : 0;
    if (order !== 0) return order;
  }
  return one.length - other.length;
}

function code(letter) {
  return letter.codePointAt(0);
}

// Generated code

@SUPPORT@
@PROGRAM@
