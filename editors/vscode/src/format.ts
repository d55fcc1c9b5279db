// Formatting by `plctool fmt -` where there is no language server that does it.

import { spawn } from 'node:child_process';
import * as vscode from 'vscode';

import { folderOf, LANGUAGE, tool } from './setup';

export function registerFormatter(): vscode.Disposable {
  return vscode.languages.registerDocumentFormattingEditProvider({ language: LANGUAGE }, {
    async provideDocumentFormattingEdits(document, _, token) {
      const formatted = await format(document.getText(), folderOf(document.uri), token);
      const whole = new vscode.Range(0, 0, document.lineCount, 0);
      return formatted === document.getText() ? [] : [vscode.TextEdit.replace(whole, formatted)];
    },
  });
}

function format(text: string, folder: string | undefined, token: vscode.CancellationToken): Promise<string> {
  const { path, environment } = tool();
  return new Promise((resolve, reject) => {
    const child = spawn(path, ['fmt', '-'], { cwd: folder, env: { ...process.env, ...environment } });
    let formatted = '';
    let said = '';
    token.onCancellationRequested(() => child.kill());
    child.on('error', reject);
    child.stdout.setEncoding('utf8').on('data', (piece: string) => (formatted += piece));
    child.stderr.setEncoding('utf8').on('data', (piece: string) => (said += piece));
    child.on('close', (code) => {
      if (code === 0) resolve(formatted);
      else reject(new Error(said.trim().split('\n')[0]));
    });
    child.stdin.on('error', () => undefined); // it ended before it read all; its exit code says why
    child.stdin.end(text);
  });
}
