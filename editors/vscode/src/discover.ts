// Tests in sources and the reports of what ran them. Without VS Code.

import { isObject, number, objects, text, type JsonObject } from './json';

export interface FoundTest {
  readonly name: string;
  /** From 0. */
  readonly line: number;
}

export interface Outcome {
  readonly name: string;
  readonly file: string;
  readonly passed: boolean;
  readonly milliseconds: number;
  readonly message: string;
  /** Of the failure, from 0; undefined for one without a line. */
  readonly line?: number;
  readonly actual?: string;
  readonly expected?: string;
}

const COMMENTS_AND_TESTS =
  /\/\/[^\n]*|\(\*|\/\*|\{[^{}]*\}|\bTEST\s*('(?:[^'$\n]|\$[^\n])*'|"(?:[^"$\n]|\$[^\n])*")|'(?:[^'$\n]|\$[^\n])*'|"(?:[^"$\n]|\$[^\n])*"/gi;

/** The TEST blocks of a source, also of one that is not finished. Comments nest. */
export function findTests(source: string): FoundTest[] {
  const found: FoundTest[] = [];
  COMMENTS_AND_TESTS.lastIndex = 0;
  for (let match = COMMENTS_AND_TESTS.exec(source); match !== null; match = COMMENTS_AND_TESTS.exec(source)) {
    if (match[0] === '(*' || match[0] === '/*') {
      COMMENTS_AND_TESTS.lastIndex = endOfComment(source, match.index, match[0]);
    } else if (match[1] !== undefined) {
      found.push({ name: unescaped(match[1].slice(1, -1)), line: lineOf(source, match.index) });
    }
  }
  return found;
}

function endOfComment(source: string, start: number, open: string): number {
  const close = open === '(*' ? '*)' : '*/';
  let depth = 1;
  for (let at = start + 2; at < source.length; at++) {
    const two = source.slice(at, at + 2);
    if (two !== open && two !== close) continue;
    depth += two === open ? 1 : -1;
    at++;
    if (depth === 0) return at + 1;
  }
  return source.length;
}

function lineOf(source: string, offset: number): number {
  return source.slice(0, offset).split('\n').length - 1;
}

const ESCAPES: Record<string, string> = { L: '\n', N: '\n', P: '\f', R: '\r', T: '\t' };

function unescaped(name: string): string {
  return name.replace(/\$([0-9A-F]{2}|.)/gi, (_, code: string) =>
    code.length === 2 ? String.fromCharCode(parseInt(code, 16)) : (ESCAPES[code.toUpperCase()] ?? code),
  );
}

/** The tests of a Python file: functions, and methods of classes, that pytest takes. */
export function findPythonTests(source: string): FoundTest[] {
  const found: FoundTest[] = [];
  let group = '';
  source.split('\n').forEach((content, line) => {
    const match = /^(\s*)(?:async\s+)?(class|def)\s+(\w+)/.exec(content);
    if (match === null) return;
    const [, indent, kind, name] = match as unknown as [string, string, string, string];
    if (indent === '') group = kind === 'class' && name.startsWith('Test') ? name : '';
    if (kind !== 'def' || !name.startsWith('test')) return;
    if (indent === '') found.push({ name, line });
    else if (group !== '') found.push({ name: `${group}::${name}`, line });
  });
  return found;
}

/** What `plctool test --json` reports. */
export function outcomesOf(document: JsonObject): Outcome[] {
  return objects(document.tests).map((test) => ({
    name: text(test.name),
    file: text(test.file),
    passed: test.passed === true,
    milliseconds: number(test.seconds) * 1000,
    ...failureOf(test.failure),
  }));
}

function failureOf(failure: JsonObject[string] | undefined): Pick<Outcome, 'message' | 'line' | 'actual' | 'expected'> {
  if (!isObject(failure)) return { message: '' };
  const said = [text(failure.text), text(failure.message)].filter((part) => part !== '').join(' ');
  const isCompared = !isObject(failure.actual) && failure.expected !== null && failure.expected !== undefined;
  return {
    message: `${text(failure.kind)}: ${said}`,
    ...(number(failure.line) > 0 ? { line: number(failure.line) - 1 } : {}),
    ...(isCompared ? { actual: JSON.stringify(failure.actual), expected: JSON.stringify(failure.expected) } : {}),
  };
}

/** The filter for `plctool test -k` that matches a name and little else: its own wildcards match themselves. */
export function filterFor(names: readonly string[]): string[] {
  const [only] = names;
  return names.length === 1 && only !== undefined ? ['-k', only] : [];
}

/** What a report of pytest in JUnit's format says, by the name of `findPythonTests`. */
export function junitOutcomes(xml: string): Map<string, Outcome> {
  const found = new Map<string, Outcome>();
  for (const match of xml.matchAll(/<testcase\b([^>]*?)(?:\/>|>([\s\S]*?)<\/testcase>)/g)) {
    const attributes = match[1] ?? '';
    const group = /(?:^|\.)(Test\w*)$/.exec(attribute(attributes, 'classname'))?.[1];
    const plain = attribute(attributes, 'name').replace(/\[.*$/s, '');
    const name = group === undefined ? plain : `${group}::${plain}`;
    const failure = /<(?:failure|error)\b([^>]*)>([\s\S]*?)<\/(?:failure|error)>/.exec(match[2] ?? '');
    const message = failure === null ? '' : `${attribute(failure[1] ?? '', 'message')}\n${decoded(failure[2] ?? '')}`;
    const milliseconds = Number(attribute(attributes, 'time')) * 1000;
    const previous = found.get(name);
    found.set(name, {
      name,
      file: attribute(attributes, 'file'),
      passed: failure === null && (previous?.passed ?? true),
      milliseconds: milliseconds + (previous?.milliseconds ?? 0),
      message: [previous?.message ?? '', message].filter((part) => part !== '').join('\n'),
    });
  }
  return found;
}

function attribute(attributes: string, name: string): string {
  return decoded(new RegExp(`\\b${name}="([^"]*)"`).exec(attributes)?.[1] ?? '');
}

const ENTITIES: Record<string, string> = { lt: '<', gt: '>', quot: '"', apos: "'", amp: '&' };

function decoded(xml: string): string {
  return xml.replace(/&(?:#(\d+)|#x([0-9a-f]+)|(\w+));/gi, (whole, decimal?: string, hex?: string, name?: string) => {
    if (decimal !== undefined) return String.fromCodePoint(Number(decimal));
    if (hex !== undefined) return String.fromCodePoint(parseInt(hex, 16));
    return ENTITIES[name ?? ''] ?? whole;
  });
}
