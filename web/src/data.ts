// What drlsl view writes into the page: drlsl/driving/page/page_file.py makes it.

export interface Lane {
  id: number;
  direction: "left_to_right" | "right_to_left";
  centre_m: number;
  width_m: number;
  speed_limit_mps: number;
  // Where the lane ends; absent if it goes on.
  end_m?: number;
}

export interface Box {
  x_m: number;
  y_m: number;
  vx_mps: number;
  vy_mps: number;
  length_m: number;
  width_m: number;
  lane?: number;
}

export interface Ego extends Box {
  target_lane?: number;
}

export interface Vehicle extends Box {
  id: string;
}

// A scene has the form of scene.json.
export interface Scene {
  road: { lanes: Lane[]; time_step_s: number; radar_range_m: number };
  ego: Ego;
  vehicles: Vehicle[];
}

export interface Clause {
  file: string;
  line: number;
  text: string;
}

export interface ReasonKind {
  action: number;
  clause: number;
  reason: string;
  arguments: (string | null)[];
}

export interface Ending {
  kind: "completed" | "contact" | "off_road" | "scene";
  words: string;
  // The vehicle of a contact.
  vehicle: string;
}

export interface EpisodeData {
  name: string;
  recording: string;
  enforced: boolean;
  ending: Ending;
  wants: string;
  road: Scene["road"];
  frames: number;
  // The time at which it opens [s].
  begin: number;
  observation: [string, number, number][];
  clauses: Clause[];
  names: string[];
  unit: number;
  reasons: ReasonKind[];
  numbers: number;
  failures: Record<string, string>;
  columns: string;
  scene: Scene | null;
  program: number;
}

// The numbers that a scene.json may leave out.
export type Defaults = Record<"vy_mps" | "length_m" | "width_m" | "time_step_s" | "radar_range_m", number>;

export interface ProgramData {
  // The module as text, deflated; or why there is none.
  module: string | null;
  refused: string;
  clauses: Clause[];
}

export interface Data {
  made_by: string;
  title: string;
  step: number;
  fine: number;
  none: number;
  actions: string[];
  colours: Record<string, string>;
  defaults: Defaults;
  episodes: EpisodeData[];
  programs: ProgramData[];
  show: number[];
}

export interface Objection {
  reason: string;
  vehicle?: string;
  gap?: number;
  needed?: number;
  missing?: number;
  details?: (string | number)[];
  clause: number;
}

// One moment, recorded or decided in the page.
export interface Moment {
  scene: Scene;
  offered: boolean[];
  objections: Objection[][];
  targetSpeed: number;
  comfort: number | null;
  observation: number[];
  laneToKeep: number;
  frontIsFree: boolean;
  distance: number | null;
  action: number;
  preferences: number[] | null;
  // Why there is no decision, so that the fail-safe drives.
  failure: string;
}

export function wordsOf(objection: Objection): string {
  const { reason, vehicle, gap, needed, missing, details } = objection;
  if (vehicle !== undefined && gap !== undefined && needed !== undefined && missing !== undefined) {
    const place = gap <= 0 ? "alongside" : `${gap.toFixed(1)} m away`;
    return `${vehicle} is ${place}, ${needed.toFixed(1)} m needed: ${missing.toFixed(1)} m missing`;
  }
  const named = (details ?? []).map((one) => (typeof one === "string" ? one : Number(one.toPrecision(4)).toString()));
  const words = reason.replaceAll("_", " ");
  return named.length > 0 ? `${words}: ${named.join(", ")}` : words;
}

export function namesIn(objection: Objection): string[] {
  const named = (objection.details ?? []).filter((one): one is string => typeof one === "string");
  return objection.vehicle === undefined ? named : [objection.vehicle, ...named];
}

export function actionWords(action: string): string {
  return action.replaceAll("_", " ");
}

export function forward(scene: Scene): number {
  const lane = scene.road.lanes.find((one) => one.id === laneOf(scene.ego, scene));
  if (lane === undefined) return scene.ego.vx_mps >= 0 ? 1 : -1;
  return lane.direction === "left_to_right" ? 1 : -1;
}

export function laneOf(box: Box, scene: Scene): number {
  if (box.lane !== undefined) return box.lane;
  const found = scene.road.lanes.find((lane) => Math.abs(box.y_m - lane.centre_m) <= lane.width_m / 2);
  return found?.id ?? 0;
}

export function isSeen(vehicle: Box, scene: Scene): boolean {
  return !(Math.hypot(vehicle.x_m - scene.ego.x_m, vehicle.y_m - scene.ego.y_m) > scene.road.radar_range_m);
}
