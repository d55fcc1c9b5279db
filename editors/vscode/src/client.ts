// The client of the language server, `plctool lsp`.

import * as vscode from 'vscode';
import { LanguageClient, type LanguageClientOptions, type ServerOptions } from 'vscode-languageclient/node';

import { folders, LANGUAGE, settings, tool } from './setup';

export class Server implements vscode.Disposable {
  private client: LanguageClient | undefined;

  async start(): Promise<void> {
    const { path, environment } = tool();
    const folder = folders()[0];
    const server: ServerOptions = {
      command: path,
      args: ['lsp'],
      options: { env: { ...process.env, ...environment }, ...(folder === undefined ? {} : { cwd: folder }) },
    };
    const options: LanguageClientOptions = {
      documentSelector: [
        { scheme: 'file', language: LANGUAGE },
        { scheme: 'file', pattern: '**/{plc,device,library}.toml' },
        { scheme: 'file', pattern: '**/*.io.toml' },
      ],
      initializationOptions: { diagnostics: settings().get('diagnostics', 'typing'), delay: settings().get('delay', 150) },
      synchronize: {
        fileEvents: vscode.workspace.createFileSystemWatcher('**/*.{st,iec,TcPOU,TcDUT,TcGVL,TcIO,exp,xml,toml,eds}'),
      },
    };
    this.client = new LanguageClient('plctool', 'plctool', server, options);
    await this.client.start();
  }

  /** Tells the server that it has to ask for the settings again. */
  async settingsChanged(): Promise<void> {
    await this.client?.sendNotification('workspace/didChangeConfiguration', { settings: null });
  }

  async stop(): Promise<void> {
    const client = this.client;
    this.client = undefined;
    await client?.stop();
  }

  async restart(): Promise<void> {
    await this.stop();
    await this.start();
  }

  dispose(): void {
    void this.stop();
  }
}
