// Live values: the lines of `plctool watch --json` as a tree. Without VS Code.

import { isObject, text, type Json } from './json';

export interface Reading {
  readonly values: ReadonlyMap<string, Json>;
  readonly forced: ReadonlySet<string>;
}

export interface Entry {
  /** As plctool names it; undefined for an element of an array, whose index only the declaration knows. */
  readonly name: string | undefined;
  readonly label: string;
  readonly value: Json;
  readonly isForced: boolean;
  readonly hasChildren: boolean;
}

/** What a line of `plctool watch --json` says; undefined for one that is no reading. Raises Error for a message. */
export function readingOf(line: string): Reading | undefined {
  let document: Json;
  try {
    document = JSON.parse(line) as Json;
  } catch {
    return undefined;
  }
  if (!isObject(document)) return undefined;
  if (isObject(document.error)) throw new Error(text(document.error.message));
  if (!isObject(document.values)) return undefined;
  const forced = Array.isArray(document.forced) ? document.forced.filter((name) => typeof name === 'string') : [];
  return { values: new Map(Object.entries(document.values)), forced: new Set(forced) };
}

/** The entries of what is watched; below a pattern is what it matches. */
export function entriesOf(watched: readonly string[], reading: Reading | undefined): Entry[] {
  return watched.map((name) =>
    entry(name, name, isPattern(name) ? matched(name, reading) : reading?.values.get(name), reading),
  );
}

function matched(pattern: string, reading: Reading | undefined): Json {
  const escaped = pattern.replace(/[.+^${}()|[\]\\]/g, '\\$&').replaceAll('*', '.*').replaceAll('?', '.');
  const matches = new RegExp(`^${escaped}$`, 'i');
  return Object.fromEntries([...(reading?.values ?? [])].filter(([name]) => matches.test(name)));
}

export function childrenOf(parent: Entry, reading: Reading | undefined): Entry[] {
  const { name, value } = parent;
  if (name !== undefined && isPattern(name) && isObject(value)) {
    return Object.entries(value).map(([full, item]) => entry(full, full, item, reading));
  }
  if (Array.isArray(value)) return value.map((item, at) => entry(undefined, `element ${at + 1}`, item, reading));
  if (!isObject(value)) return [];
  return Object.entries(value).map(([member, item]) =>
    entry(name === undefined ? undefined : `${name}.${member}`, member, item, reading),
  );
}

function entry(name: string | undefined, label: string, value: Json | undefined, reading: Reading | undefined): Entry {
  const shown = value ?? null;
  return {
    name,
    label,
    value: shown,
    isForced: name !== undefined && (reading?.forced.has(name) ?? false),
    hasChildren: typeof shown === 'object' && shown !== null,
  };
}

/** As ST writes it; a STRING comes without its quotes. */
export function literal(value: Json): string {
  if (value === null) return '';
  if (typeof value === 'boolean') return value ? 'TRUE' : 'FALSE';
  if (Array.isArray(value)) return `[${value.length}]`;
  return typeof value === 'object' ? '(...)' : String(value);
}

export function isPattern(name: string): boolean {
  return /[*?]/.test(name);
}

/** The name that a watch of the text at a column begins with, such as Main.pump.speed; undefined if there is none. */
export function nameAt(line: string, column: number): string | undefined {
  for (const match of line.matchAll(/[\p{L}_][\p{L}\p{N}_]*(?:\.[\p{L}_][\p{L}\p{N}_]*|\[\d+(?:\s*,\s*\d+)*\])*/gu)) {
    if (match.index <= column && column <= match.index + match[0].length) return match[0];
  }
  return undefined;
}

/** The name with the POU before it, in which the line is; as it is outside of one. */
export function qualified(name: string, linesBefore: readonly string[]): string {
  for (const line of [...linesBefore].reverse()) {
    const match = /^\s*(PROGRAM|FUNCTION_BLOCK|FUNCTION|END_PROGRAM|END_FUNCTION_BLOCK|END_FUNCTION|VAR_GLOBAL)\b\s*(\w*)/i.exec(line);
    const word = match?.[1]?.toUpperCase();
    if (word === undefined) continue;
    return word === 'PROGRAM' && match?.[2] !== undefined ? `${match[2]}.${name}` : name;
  }
  return name;
}
