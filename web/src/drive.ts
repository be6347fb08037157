// An episode unpacked: drlsl/driving/page/packed_columns.py packs it.
import type { Data, EpisodeData, Moment, Objection, Scene, Vehicle } from "./data";

export async function inflate(base64: string): Promise<Uint8Array<ArrayBuffer>> {
  const packed = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

type Column = Int8Array | Int16Array | Int32Array;

class Columns {
  private readonly layout: Record<string, ["i1" | "i2" | "i4", number, number]>;
  private readonly begin: number;

  constructor(private readonly bytes: Uint8Array<ArrayBuffer>) {
    const length = new DataView(bytes.buffer, bytes.byteOffset).getUint32(0, true);
    this.layout = JSON.parse(new TextDecoder().decode(bytes.subarray(4, 4 + length)));
    this.begin = bytes.byteOffset + 4 + length;
  }

  get(name: string): Column {
    const entry = this.layout[name];
    if (entry === undefined) throw new Error(`the page has no column ${name}`);
    const [kind, place, size] = entry;
    const made = { i1: Int8Array, i2: Int16Array, i4: Int32Array }[kind];
    return new made(this.bytes.buffer, this.begin + place, size);
  }

  // The running sums of a column.
  sums(name: string): Int32Array {
    const sums = Int32Array.from(this.get(name));
    for (let n = 1; n < sums.length; n += 1) sums[n]! += sums[n - 1]!;
    return sums;
  }
}

// Speeds in rows like those of the places that they lead to, and the time of a frame [s].
interface Driven {
  speed: Int32Array;
  timeOf: (frame: number) => number;
}

// Things that last for some frames each, and the rows of values that they have in each frame.
class Tracks {
  readonly begin: Int32Array;
  readonly frames: Column;
  private readonly offset: Int32Array;
  readonly rows: number;
  private readonly active: number[][];

  constructor(private readonly columns: Columns, prefix: string, count: number) {
    this.begin = columns.sums(`${prefix}_begin`);
    this.frames = columns.get(`${prefix}_frames`);
    this.offset = new Int32Array(this.frames.length);
    this.active = Array.from({ length: count }, () => []);
    let rows = 0;
    this.frames.forEach((length, track) => {
      this.offset[track] = rows;
      rows += length;
      for (let n = 0; n < length; n += 1) this.active[this.begin[track]! + n]!.push(track);
    });
    this.rows = rows;
  }

  in(frame: number): number[] {
    return this.active[frame] ?? [];
  }

  row(track: number, frame: number): number {
    return this.offset[track]! + frame - this.begin[track]!;
  }

  // The values of the tracks that have this column, in a row for each frame of each track. Of places the column has what
  // the mean of the speeds before and after does not tell.
  values(name: string, driven: Driven | null = null, has: (track: number) => boolean = () => true): Int32Array {
    const first = this.columns.get(`${name}_first`);
    const steps = this.columns.get(`${name}_steps`);
    const values = new Int32Array(this.rows);
    let taken = 0;
    let step = 0;
    this.frames.forEach((length, track) => {
      if (!has(track)) return;
      let value = first[taken]!;
      taken += 1;
      const row = this.offset[track]!;
      values[row] = value;
      for (let n = 1; n < length; n += 1) {
        value += steps[step]!;
        step += 1;
        if (driven !== null) {
          const { speed, timeOf } = driven;
          const frame = this.begin[track]! + n;
          value += Math.floor((speed[row + n - 1]! + speed[row + n]!) * (timeOf(frame) - timeOf(frame - 1)) * 0.5 + 0.5);
        }
        values[row + n] = value;
      }
    });
    return values;
  }
}

export type MarkKind = "change" | "intervention" | "contact" | "failure" | "entry";

export interface Mark {
  frame: number;
  kind: MarkKind;
  words: string;
}

export class Drive {
  readonly marks: Mark[] = [];
  readonly duration: number;
  private readonly cars: Tracks;
  private readonly reasons: Tracks;
  private readonly x: Int32Array;
  private readonly y: Int32Array;
  private readonly vx: Int32Array;
  private readonly vy: Int32Array;
  private readonly lane: Int32Array;
  private readonly numbers: Int32Array[];
  private readonly decidedAt: Int32Array;
  private readonly frame: Int32Array;
  private readonly column: Record<string, Column>;

  constructor(readonly data: EpisodeData, private readonly page: Data, bytes: Uint8Array<ArrayBuffer>) {
    const columns = new Columns(bytes);
    const count = data.frames;
    this.cars = new Tracks(columns, "v", count);
    this.reasons = new Tracks(columns, "r", count);
    this.frame = columns.sums("frame");
    this.vx = this.cars.values("v_vx");
    this.vy = this.cars.values("v_vy");
    this.x = this.cars.values("v_x", { speed: this.vx, timeOf: (frame) => this.timeOf(frame) });
    this.y = this.cars.values("v_y", { speed: this.vy, timeOf: (frame) => this.timeOf(frame) });
    this.lane = this.cars.values("v_lane");
    const kinds = columns.get("r_kind");
    const amount = (track: number) => data.reasons[kinds[track]!]!.arguments.filter((one) => one === null).length;
    this.numbers = Array.from({ length: data.numbers }, (_, place) =>
      this.reasons.values(`r_number${place}`, null, (track) => amount(track) > place),
    );
    const each = (name: string) => columns.sums(name);
    this.column = { kinds };
    for (const name of ["target_speed", "distance", "target_lane", "lane_to_keep"]) this.column[name] = each(name);
    for (const name of ["front_is_free", "comfort", "offered", "action", "preferences", "changed", "entered"]) {
      this.column[name] = columns.get(name);
    }
    for (const name of ["v_name", "v_length", "v_width"]) this.column[name] = columns.get(name);
    const observation = Int32Array.from(columns.get("observation"));
    for (let n = 0; n < observation.length; n += 1) if (n % count > 0) observation[n]! += observation[n - 1]!;
    this.column["observation"] = observation;
    this.decidedAt = new Int32Array(count);
    let last = -1;
    for (let n = 0; n < count; n += 1) this.decidedAt[n] = last = this.column["action"]![n]! >= 0 ? n : last;
    this.duration = this.timeOf(count - 1);
    this.mark();
  }

  get length(): number {
    return this.data.frames;
  }

  timeOf(frame: number): number {
    return this.frame[frame]! * this.data.road.time_step_s;
  }

  // The last frame that is not after a time [s].
  frameAt(time: number): number {
    let low = 0;
    let high = this.length - 1;
    while (low < high) {
      const middle = Math.ceil((low + high) / 2);
      if (this.timeOf(middle) <= time + 1e-9) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  private at(name: string, place: number): number {
    return this.column[name]![place]!;
  }

  moment(frame: number): Moment {
    const { step } = this.page;
    const comfort = this.at("comfort", frame);
    const decided = this.decidedAt[frame]!;
    return {
      scene: this.scene(frame),
      offered: this.offered(frame),
      objections: this.objections(frame),
      targetSpeed: this.at("target_speed", frame) * step,
      comfort: comfort === this.page.none ? null : comfort * step,
      observation: this.data.observation.map((_, n) => this.at("observation", n * this.length + frame) * this.page.fine),
      laneToKeep: this.at("lane_to_keep", frame),
      frontIsFree: this.at("front_is_free", frame) === 1,
      distance: this.data.ending.kind === "scene" ? null : this.at("distance", frame) * 0.1,
      action: decided < 0 ? -1 : this.at("action", decided),
      preferences: decided < 0 ? null : this.preferences(decided),
      failure: this.data.failures[String(this.frame[frame])] ?? "",
    };
  }

  private offered(frame: number): boolean[] {
    return this.page.actions.map((_, action) => ((this.at("offered", frame) >> action) & 1) === 1);
  }

  // How much each action was wanted; null where it is not known.
  private preferences(frame: number): number[] | null {
    const values = this.page.actions.map((_, action) => this.at("preferences", action * this.length + frame));
    if (values.every((value) => value === this.page.none)) return null;
    return values.map((value) => (value === this.page.none ? -Infinity : value * this.data.unit));
  }

  private scene(frame: number): Scene {
    if (this.data.scene !== null) return this.data.scene;
    const { step } = this.page;
    const vehicles: Vehicle[] = this.cars.in(frame).map((track) => {
      const row = this.cars.row(track, frame);
      const lane = this.lane[row]!;
      return {
        id: this.data.names[this.at("v_name", track)]!,
        x_m: rounded(this.x[row]! * step),
        y_m: rounded(this.y[row]! * step),
        vx_mps: rounded(this.vx[row]! * step),
        vy_mps: rounded(this.vy[row]! * step),
        length_m: rounded(this.at("v_length", track) * step),
        width_m: rounded(this.at("v_width", track) * step),
        ...(lane > 0 ? { lane } : {}),
      };
    });
    const place = vehicles.findIndex((one) => one.id === "ego");
    const [{ id: _, ...ego }] = vehicles.splice(place, 1) as [Vehicle];
    return { road: this.data.road, ego: { ...ego, target_lane: this.at("target_lane", frame) }, vehicles };
  }

  private objections(frame: number): Objection[][] {
    const found: Objection[][] = this.page.actions.map(() => []);
    for (const track of this.reasons.in(frame)) {
      const kind = this.data.reasons[this.at("kinds", track)]!;
      const row = this.reasons.row(track, frame);
      let taken = 0;
      const details = kind.arguments.map((one) => {
        if (one !== null) return one;
        taken += 1;
        return this.numbers[taken - 1]![row]! * this.page.fine;
      });
      found[kind.action]!.push({ ...objectionOf(kind.reason, details), clause: kind.clause });
    }
    for (const some of found) some.sort((one, other) => (one.gap ?? -Infinity) - (other.gap ?? -Infinity));
    return found;
  }

  private mark(): void {
    for (let n = 0; n < this.length; n += 1) {
      if (this.at("changed", n) === 1) this.marks.push({ frame: n, kind: "change", words: "lane change begins" });
      if (this.at("entered", n) === 1) this.marks.push({ frame: n, kind: "entry", words: "enters the stretch again" });
      const failure = this.data.failures[String(this.frame[n])];
      if (failure !== undefined) this.marks.push({ frame: n, kind: "failure", words: `fail-safe: ${failure}` });
      if (this.decidedAt[n] === n && this.intervened(n)) {
        this.marks.push({ frame: n, kind: "intervention", words: "wanted what was not offered" });
      }
    }
    const { kind, words } = this.data.ending;
    if (kind === "contact" || kind === "off_road") this.marks.push({ frame: this.length - 1, kind: "contact", words });
  }

  private intervened(frame: number): boolean {
    const wanted = this.preferences(frame);
    if (wanted === null) return false;
    const best = wanted.indexOf(Math.max(...wanted));
    return !this.offered(frame)[best];
  }
}

export function objectionOf(reason: string, details: (string | number)[]): Omit<Objection, "clause"> {
  const [vehicle, gap, needed] = details;
  const close = reason === "too_close" && details.length === 3 && typeof vehicle === "string";
  if (close && typeof gap === "number" && typeof needed === "number") {
    return { reason, vehicle, gap, needed, missing: needed - gap };
  }
  return details.length > 0 ? { reason, details } : { reason };
}

function rounded(value: number): number {
  return Math.round(value * 1000) / 1000;
}
