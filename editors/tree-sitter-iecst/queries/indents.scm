; The style of `plctool fmt`: the declarations and statements of a POU begin at the column of its first word.

[
  (type_block)
  (structure_type)
  (variable_block)
  (config_block)
  (access_block)
  (property)
  (accessor)
  (action)
  (step)
  (configuration)
  (resource)
  (if_statement)
  (case_statement)
  (case_branch)
  (for_statement)
  (while_statement)
  (repeat_statement)
  (try_statement)
  (arguments)
  (array_initializer)
  (structure_initializer)
] @indent.begin

[
  "END_TYPE"
  "END_STRUCT"
  "END_UNION"
  "END_VAR"
  "END_PROPERTY"
  "END_GET"
  "END_SET"
  "END_ACTION"
  "END_STEP"
  "END_CONFIGURATION"
  "END_RESOURCE"
  "ELSIF"
  "ELSE"
  "END_IF"
  "END_CASE"
  "END_FOR"
  "END_WHILE"
  "UNTIL"
  "END_REPEAT"
  "__CATCH"
  "__FINALLY"
  "__ENDTRY"
  ")"
  "]"
] @indent.branch

[
  "END_TYPE"
  "END_STRUCT"
  "END_UNION"
  "END_VAR"
  "END_PROPERTY"
  "END_GET"
  "END_SET"
  "END_ACTION"
  "END_STEP"
  "END_CONFIGURATION"
  "END_RESOURCE"
  "END_IF"
  "END_CASE"
  "END_FOR"
  "END_WHILE"
  "END_REPEAT"
  "__ENDTRY"
] @indent.end

(comment) @indent.auto
