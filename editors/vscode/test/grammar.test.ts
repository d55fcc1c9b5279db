import assert from 'node:assert/strict';
import { readdirSync, readFileSync } from 'node:fs';
import * as path from 'node:path';
import { test } from 'node:test';
import { createOnigScanner, createOnigString, loadWASM } from 'vscode-oniguruma';
import { INITIAL, parseRawGrammar, Registry, type IGrammar } from 'vscode-textmate';

const HERE = process.cwd();
const SOURCES = path.resolve(HERE, '..', '..', 'tests', 'st');

async function grammar(): Promise<IGrammar> {
  const wasm = readFileSync(path.join(HERE, 'node_modules/vscode-oniguruma/release/onig.wasm'));
  await loadWASM(wasm.buffer.slice(wasm.byteOffset, wasm.byteOffset + wasm.byteLength));
  const registry = new Registry({
    onigLib: Promise.resolve({ createOnigScanner, createOnigString }),
    loadGrammar: (scope) => {
      assert.equal(scope, 'source.iecst');
      const file = path.join(HERE, 'syntaxes/iecst.tmLanguage.json');
      return Promise.resolve(parseRawGrammar(readFileSync(file, 'utf8'), file));
    },
  });
  const loaded = await registry.loadGrammar('source.iecst');
  assert.ok(loaded);
  return loaded;
}

const loading = grammar();

/** The innermost scope of each word and sign of a text, in their order. */
async function scopes(source: string): Promise<[string, string][]> {
  const iecst = await loading;
  let state = INITIAL;
  return source.split('\n').flatMap((line) => {
    const { tokens, ruleStack } = iecst.tokenizeLine(line, state);
    state = ruleStack;
    return tokens
      .map(({ startIndex, endIndex, scopes: found }): [string, string] => [
        line.slice(startIndex, endIndex).trim(),
        (found.at(-1) ?? '').replace(/\.iecst$/, ''),
      ])
      .filter(([text]) => text !== '');
  });
}

async function scopeOf(source: string, word: string): Promise<string | undefined> {
  return (await scopes(source)).find(([text]) => text === word)?.[1];
}

void test('keywords in any case, names and types are told apart', async () => {
  const source = 'Function_Block Pump\nvar_input speed : lreal; other : Motor; END_VAR\nif speed > 1 then Start(); END_IF';
  assert.equal(await scopeOf(source, 'Function_Block'), 'keyword.declaration.unit');
  assert.equal(await scopeOf(source, 'Pump'), 'entity.name.function');
  assert.equal(await scopeOf(source, 'var_input'), 'storage.type.variables');
  assert.equal(await scopeOf(source, 'lreal'), 'storage.type');
  assert.equal(await scopeOf(source, 'Motor'), 'variable.other');
  assert.equal(await scopeOf(source, 'then'), 'keyword.control');
  assert.equal(await scopeOf(source, 'Start'), 'entity.name.function.call');
});

void test('comments nest', async () => {
  const found = await scopes('(* a (* b *) still *) x := 1; // end\n/* y */ z');
  assert.deepEqual(
    found.filter(([, scope]) => scope === 'variable.other').map(([text]) => text),
    ['x', 'z'],
  );
});

void test('a keyword after a point is a member', async () => {
  assert.equal(await scopeOf('a.END_IF := b.task;', 'END_IF'), 'variable.other.member');
  assert.equal(await scopeOf('a.END_IF := b.task;', 'task'), 'variable.other.member');
});

void test('literals have their kinds', async () => {
  const kinds: Record<string, string> = {
    'T#1d2h_3.5ms': 'constant.other.duration',
    'DT#2020-01-01-12:30:00.5': 'constant.other.date',
    '16#FF_FF': 'constant.numeric',
    '1.5E-3': 'constant.numeric',
    'WORD#16#FF': 'constant.numeric',
    'Color#red': 'constant.other.enum',
    '%QX1.2': 'variable.other.address',
    TRUE: 'constant.language',
  };
  for (const [literal, kind] of Object.entries(kinds)) assert.equal(await scopeOf(`x := ${literal};`, literal), kind);
  assert.deepEqual((await scopes('0..9')).map(([, scope]) => scope), ['constant.numeric', 'keyword.operator', 'constant.numeric']);
});

void test('a $ escapes the quote of a string, whose end is that of the line at the latest', async () => {
  assert.equal(await scopeOf("x := 'it$'s'; y", 'y'), 'variable.other');
  assert.equal(await scopeOf("x := 'open\ny", 'y'), 'variable.other');
});

void test('the XML around a POU of TwinCAT is no program', async () => {
  const source = '<TcPlcObject Version="1">\n  <POU Name="A">\n    <Declaration><![CDATA[PROGRAM A]]></Declaration>\na <b AND c> d;';
  assert.equal(await scopeOf(source, 'PROGRAM'), 'keyword.declaration.unit');
  assert.equal(await scopeOf(source, 'AND'), 'keyword.operator.word');
  assert.equal((await scopes(source))[0]?.[1], 'meta.tag.xml');
});

void test('no source of the compiler leaves a comment, pragma or string open at its end', async () => {
  const iecst = await loading;
  const open: string[] = [];
  for (const file of readdirSync(SOURCES, { recursive: true, encoding: 'utf8' }).filter((name) => name.endsWith('.st'))) {
    const source = readFileSync(path.join(SOURCES, file), 'utf8');
    if (source.includes('expect-error')) continue;
    let state = INITIAL;
    for (const line of source.split('\n')) state = iecst.tokenizeLine(line, state).ruleStack;
    const after = iecst.tokenizeLine('after', state).tokens[0]?.scopes.at(-1);
    if (after !== 'variable.other.iecst') open.push(path.basename(file));
  }
  // The compiler ends that comment where a system without nesting would, which takes a look at the whole text.
  assert.deepEqual(open, ['comment_that_does_not_nest_is_a_warning.st']);
});
