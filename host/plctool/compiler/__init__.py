"""The compiler: IEC 61131-3 Structured Text in, an application image and its symbols out."""
