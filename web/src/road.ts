// The road around the ego from above, on a canvas: as drlsl render draws it.
import { forward, isSeen, namesIn, type Box, type Lane, type Moment, type Objection, type Scene, type Vehicle } from "./data";

// Lengths in m, as in drlsl/driving/rendering/road_view.py.
const SHOULDER = 1.5;
const AHEAD = 0.62;
const BEYOND = 1.15;
const DASH = 6;
const DASHES = 18;
const CHEVRONS = 60;
const ARROW = 9;

// The least pixels for a metre: on a narrow screen one sees less far.
const LEAST = 3.2;
const MARGIN = 30;

export interface Camera {
  x: number;
  y: number;
  along: number;
  across: number;
  width: number;
  height: number;
}

export function cameraOf(scene: Scene, width: number): Camera {
  const { lanes, radar_range_m: range } = scene.road;
  const low = Math.min(...lanes.map((lane) => lane.centre_m - lane.width_m / 2)) - SHOULDER;
  const high = Math.max(...lanes.map((lane) => lane.centre_m + lane.width_m / 2)) + SHOULDER;
  const along = Math.max((width * AHEAD) / (range * BEYOND), LEAST);
  const across = Math.min(Math.max(2 * along, 9), 260 / (high - low), 4 * along);
  const height = Math.ceil((high - low) * across + 2 * MARGIN);
  const left = ((forward(scene) > 0 ? 1 - AHEAD : AHEAD) * width) / along;
  return { x: scene.ego.x_m - left, y: low - MARGIN / across, along, across, width, height };
}

export function pixel(camera: Camera, x: number, y: number): [number, number] {
  return [(x - camera.x) * camera.along, (y - camera.y) * camera.across];
}

export function place(camera: Camera, left: number, top: number): [number, number] {
  return [left / camera.along + camera.x, top / camera.across + camera.y];
}

// The gap to a vehicle that is too close, and what is missing of it; null if its gap is no distance on the road.
export function dimension(ego: Box, other: Box, objection: Objection): { from: number[]; to: number[]; end: number[] } | null {
  const { gap, missing } = objection;
  if (gap === undefined || missing === undefined) return null;
  const side = other.x_m >= ego.x_m ? 1 : -1;
  // Places on the page are rounded, so the gap is known to a few centimetres.
  const near = (length: number) => Math.abs(gap - length) <= 0.05;
  const bumpers = Math.abs(ego.x_m - other.x_m) - (ego.length_m + other.length_m) / 2;
  if (near(bumpers)) {
    const [own, theirs] = [ego.x_m + (side * ego.length_m) / 2, other.x_m - (side * other.length_m) / 2];
    return { from: [own, other.y_m], to: [theirs, other.y_m], end: [theirs + side * missing, other.y_m] };
  }
  const [dx, dy] = [other.x_m - ego.x_m, other.y_m - ego.y_m];
  const distance = Math.hypot(dx, dy);
  if (distance === 0 || !near(distance)) return null;
  const end = [other.x_m + (missing * dx) / distance, other.y_m + (missing * dy) / distance];
  return { from: [ego.x_m, ego.y_m], to: [other.x_m, other.y_m], end };
}

export interface Look {
  colours: Record<string, string>;
  selected: string | null;
  // The vehicle that the ego is in contact with.
  struck: string;
}

// Draws a moment and returns the camera; a camera that is held shows the same stretch of road as before.
export function drawRoad(canvas: HTMLCanvasElement, moment: Moment, look: Look, held: Camera | null): Camera {
  const width = canvas.clientWidth || 600;
  const camera = held ?? cameraOf(moment.scene, width);
  const ratio = window.devicePixelRatio || 1;
  const size: [number, number] = [Math.round(width * ratio), Math.round(camera.height * ratio)];
  if (canvas.width !== size[0] || canvas.height !== size[1]) {
    [canvas.width, canvas.height] = size;
    canvas.style.height = `${camera.height}px`;
  }
  const context = canvas.getContext("2d")!;
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  new Painter(context, camera, moment, look).paint();
  return camera;
}

class Painter {
  private readonly scene: Scene;

  constructor(
    private readonly context: CanvasRenderingContext2D,
    private readonly camera: Camera,
    private readonly moment: Moment,
    private readonly look: Look,
  ) {
    this.scene = moment.scene;
  }

  paint(): void {
    const { context, camera, look } = this;
    context.fillStyle = look.colours["grass"]!;
    context.fillRect(0, 0, camera.width, camera.height);
    this.lanes();
    this.radar();
    for (const car of this.scene.vehicles) this.vehicle(car, isSeen(car, this.scene) ? "seen" : "unseen", car.id);
    this.vehicle(this.scene.ego, "ego", "ego");
    this.gaps();
    this.actions();
  }

  private colour(name: string): string {
    return this.look.colours[name]!;
  }

  private point(x: number, y: number): [number, number] {
    return pixel(this.camera, x, y);
  }

  private line(points: [number, number][], colour: string, width: number): void {
    const { context } = this;
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.beginPath();
    points.forEach(([x, y], n) => (n === 0 ? context.moveTo(x, y) : context.lineTo(x, y)));
    context.stroke();
  }

  private every(distance: number): number[] {
    const [begin, end] = [this.camera.x, this.camera.x + this.camera.width / this.camera.along];
    const first = Math.floor(begin / distance);
    return Array.from({ length: Math.ceil(end / distance) - first }, (_, n) => (first + n) * distance);
  }

  private lanes(): void {
    const { context, camera } = this;
    const lanes = [...this.scene.road.lanes].sort((one, other) => one.centre_m - other.centre_m);
    context.fillStyle = this.colour("asphalt");
    for (const lane of lanes) {
      const top = this.point(0, lane.centre_m - lane.width_m / 2)[1];
      context.fillRect(0, top, camera.width, Math.ceil(lane.width_m * camera.across) + 0.5);
    }
    const edge = (y: number): void => {
      const top = this.point(0, y)[1];
      this.line([[0, top], [camera.width, top]], this.colour("line"), 2);
    };
    for (const direction of ["left_to_right", "right_to_left"]) {
      const alike = lanes.filter((lane) => lane.direction === direction);
      alike.forEach((lane, n) => {
        const next = alike[n + 1];
        if (n === 0) edge(lane.centre_m - lane.width_m / 2);
        if (next === undefined) edge(lane.centre_m + lane.width_m / 2);
        else this.dashes((lane.centre_m + lane.width_m / 2 + next.centre_m - next.width_m / 2) / 2);
        this.chevrons(lane);
      });
    }
    for (const lane of lanes) if (lane.end_m !== undefined) this.end(lane, lane.end_m);
  }

  // Grass beyond the end of a lane, and a line at it: the outer line goes, the one to the next lane stays.
  private end(lane: Lane, x: number): void {
    const { context, camera } = this;
    const sign = lane.direction === "left_to_right" ? 1 : -1;
    const [at, top] = this.point(x, lane.centre_m - lane.width_m / 2);
    const height = lane.width_m * camera.across;
    const [begin, stop] = sign > 0 ? [Math.max(0, at), camera.width] : [0, Math.min(at, camera.width)];
    context.fillStyle = this.colour("grass");
    if (stop > begin) context.fillRect(begin, top + 2 * sign, stop - begin, height + 1);
    this.line([[at, top], [at, top + height]], this.colour("line"), 4);
  }

  private dashes(y: number): void {
    for (const x of this.every(DASHES)) this.line([this.point(x, y), this.point(x + DASH, y)], this.colour("line"), 2);
  }

  private chevrons(lane: Lane): void {
    const depth = lane.direction === "left_to_right" ? 1.2 : -1.2;
    const y = lane.centre_m;
    for (const x of this.every(CHEVRONS)) {
      this.line([this.point(x - depth, y - 0.5), this.point(x, y), this.point(x - depth, y + 0.5)], this.colour("chevron"), 2);
    }
  }

  private radar(): void {
    const { context, camera } = this;
    const range = this.scene.road.radar_range_m;
    const [x, y] = this.point(this.scene.ego.x_m, this.scene.ego.y_m);
    context.save();
    context.beginPath();
    context.rect(0, MARGIN, camera.width, camera.height - 2 * MARGIN);
    context.clip();
    context.strokeStyle = this.colour("radar");
    context.lineWidth = 2;
    context.beginPath();
    context.ellipse(x, y, range * camera.along, range * camera.across, 0, 0, 2 * Math.PI);
    context.stroke();
    context.restore();
  }

  private vehicle(car: Box, colour: string, id: string): void {
    const { context, camera } = this;
    const [left, top] = this.point(car.x_m - car.length_m / 2, car.y_m - car.width_m / 2);
    const [width, height] = [car.length_m * camera.along, car.width_m * camera.across];
    if (left > camera.width || left + width < 0) return;
    context.beginPath();
    const radius = Math.min(4, width / 3, height / 3);
    context.moveTo(left + radius, top);
    context.arcTo(left + width, top, left + width, top + height, radius);
    context.arcTo(left + width, top + height, left, top + height, radius);
    context.arcTo(left, top + height, left, top, radius);
    context.arcTo(left, top, left + width, top, radius);
    context.fillStyle = this.colour(colour);
    context.fill();
    const chosen = this.look.selected === id;
    context.strokeStyle = chosen ? this.colour("selected") : this.colour("outline");
    context.lineWidth = chosen ? 3 : 1;
    context.stroke();
  }

  private gaps(): void {
    const cars = new Map<string, Vehicle>(this.scene.vehicles.map((car) => [car.id, car]));
    const ego = this.scene.ego;
    const named = new Set<string>();
    for (const objection of this.moment.objections.flat()) {
      for (const name of namesIn(objection)) named.add(name);
      const car = cars.get(objection.vehicle ?? "");
      const line = car === undefined ? null : dimension(ego, car, objection);
      if (line === null) continue;
      const [from, to, end] = [line.from, line.to, line.end].map(([x, y]) => this.point(x!, y!)) as [number, number][];
      this.line([from!, to!], this.colour("gap"), 2);
      this.line([to!, end!], this.colour("refused"), 6);
      this.label(`${objection.missing!.toFixed(1)} m missing`, (to![0] + end![0]) / 2, to![1] + 16);
    }
    for (const name of named) {
      const car = cars.get(name);
      if (car !== undefined) this.frame(car, `${name} ${Math.abs(car.vx_mps).toFixed(1)} m/s`, "refused");
    }
    const struck = cars.get(this.look.struck);
    if (struck !== undefined) this.frame(struck, `contact with ${struck.id}`, "alarm");
  }

  private frame(car: Box, words: string, colour: string): void {
    const [left, top] = this.point(car.x_m - car.length_m / 2, car.y_m - car.width_m / 2);
    const [width, height] = [car.length_m * this.camera.along, car.width_m * this.camera.across];
    this.context.strokeStyle = this.colour(colour);
    this.context.lineWidth = 3;
    this.context.strokeRect(left - 3, top - 3, width + 6, height + 6);
    this.label(words, left + width / 2, top - 8);
  }

  private label(words: string, x: number, y: number): void {
    const { context, camera } = this;
    context.font = "12px system-ui, sans-serif";
    const width = context.measureText(words).width;
    const left = Math.min(Math.max(x - width / 2, 4), camera.width - width - 4);
    context.fillStyle = this.colour("label");
    context.fillRect(left - 3, y - 11, width + 6, 15);
    context.fillStyle = this.colour("text");
    context.fillText(words, left, y);
  }

  private actions(): void {
    const { ego, road } = this.scene;
    const ahead = forward(this.scene);
    const lane = road.lanes.find((one) => one.id === ego.lane) ?? road.lanes[0]!;
    const aside = [0, -1, 1];
    this.moment.offered.forEach((offered, action) => {
      const nose = ego.x_m + ahead * (ego.length_m / 2 + 0.5);
      const begin = this.point(nose, ego.y_m);
      const end = this.point(nose + ahead * ARROW, ego.y_m + aside[action]! * ahead * lane.width_m);
      const against = this.moment.objections[action]!.length > 0;
      const colour = this.colour(offered && !against ? "offered" : "refused");
      this.line([begin, end], colour, 3);
      if (offered) this.head(begin, end, colour);
      else this.cross(end, colour);
    });
  }

  private head(begin: [number, number], end: [number, number], colour: string): void {
    const { context } = this;
    const angle = Math.atan2(end[1] - begin[1], end[0] - begin[0]);
    context.fillStyle = colour;
    context.beginPath();
    context.moveTo(...end);
    for (const turn of [0.45, -0.45]) {
      context.lineTo(end[0] - 10 * Math.cos(angle + turn), end[1] - 10 * Math.sin(angle + turn));
    }
    context.fill();
  }

  private cross([x, y]: [number, number], colour: string): void {
    for (const dy of [-5, 5]) this.line([[x - 5, y - dy], [x + 5, y + dy]], colour, 3);
  }
}
