/* How generated code in JavaScript reads facts. */

function is_sound(value, kind) {
  if (kind === "atom") return typeof value === "string";
  if (kind === "int") return Number.isSafeInteger(value);
  return typeof value === "number" && Math.abs(value) <= MOST;
}

// The rows as objects, with a blank one at the end; null if they do not conform to the schema.
function rows_of(rows, relation) {
  const { fields, kinds, used, single, key, first } = relation;
  if ((single && rows.length !== 1) || rows.some((row) => row.length !== fields.length)) return null;
  if (first !== null && (rows.length === 0 || rows[0][key] !== first)) return null;
  if (key !== null && new Set(rows.map((row) => row[key])).size !== rows.length) return null;
  if (!rows.every((row) => used.every((place) => is_sound(row[place], kinds[place])))) return null;
  const blank = kinds.map((kind) => (kind === "atom" ? "" : 0));
  return [...rows, blank].map((row) => Object.fromEntries(fields.map((field, place) => [field, row[place]])));
}

function find_row(rows, count, field, key) {
  for (let place = 0; place < count; place += 1) {
    if (rows[place][field] === key) return place;
  }
  return count;
}

function distinct(items) {
  return [...new Map(items.map((item) => [JSON.stringify(item), item])).values()];
}
